"""The order of rooms: a module imports from its own room and from rooms below it, and modules never import in a circle.

A room is a folder of a package, or a single module beside the folders.
"""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# From the ground up. A package's own `__init__` is above all of its rooms: it only passes names on.
ROOMS = {
    "pss": (
        *("errors", "hints", "json_text", "toml_text", "files", "entry_points", "inputs"),
        *("riccati", "processes", "cameras", "surrogates", "noise", "visibility", "modalities"),
        *("metric", "rivals", "metrics"),
    ),
    "render": (
        *("code_digest", "random_streams", "images", "backend", "sensor"),
        *("world", "light", "keys", "lens", "certificate", "renderer", "files", "captures", "store", "viewing"),
    ),
    "scenes": (
        *("errors", "reading", "people", "schema", "mesh_file", "markers", "rules", "from_tables", "scene", "steps"),
    ),
    "validate": (
        *("runs", "stats", "markers", "prediction", "points", "acquire"),
        *("sweeps", "bank", "schedule", "pixel_noise"),
        *("plots", "tracked_walk", "pages", "comparison", "schedule_pages", "findings", "results"),
        *("commands", "run_sweep"),
    ),
}
LAYERS = ("pss", "render", "scenes", "validate")
# What stands on what, at most: more floors are more to climb from a marker in an image to a row of a table.
MOST_FLOORS = 12


@cache
def modules() -> dict[str, Path]:
    """Every module of the packages by its dotted name; a package by its `__init__`."""
    found = {}
    for package in LAYERS:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def passed_on(package: str) -> dict[str, tuple[str, str]]:
    """The names that a package's `__init__` takes from elsewhere: (module, name) of each."""
    if modules()[package].name != "__init__.py":
        return {}
    tree = ast.parse(modules()[package].read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def defined_in(module: str, name: str) -> str:
    """The module that `from module import name` gets the name from."""
    if f"{module}.{name}" in modules():
        return f"{module}.{name}"
    if name in passed_on(module):
        return defined_in(*passed_on(module)[name])
    return module


@cache
def imports(module: str) -> frozenset[str]:
    """The project's modules that a module imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in modules()}
        elif isinstance(node, ast.ImportFrom) and node.module in modules():
            found |= {defined_in(node.module, alias.name) for alias in node.names}
    return frozenset(found - {module})


def is_face(module: str) -> bool:
    return modules()[module].name == "__init__.py"


def room(module: str) -> str:
    """The first two names: the package, and the folder or module in it."""
    return ".".join(module.split(".")[:2])


def place(module: str) -> tuple[int, int]:
    """Layer and place in its order."""
    package, _, name = room(module).partition(".")
    return LAYERS.index(package), ROOMS[package].index(name)


@pytest.mark.parametrize("package", LAYERS)
def test_every_room_has_a_place_in_the_order(package):
    rooms = {room(module).partition(".")[2] for module in modules() if module.startswith(f"{package}.")}
    assert rooms == set(ROOMS[package])
    assert len(ROOMS[package]) == len(set(ROOMS[package]))


@pytest.mark.parametrize("package", LAYERS)
def test_no_import_runs_upwards(package):
    wrong = [
        f"{module} imports {imported}"
        for module in modules()
        if module.startswith(f"{package}.") and not is_face(module)
        for imported in sorted(imports(module))
        if not is_face(imported) and place(imported) > place(module)
    ]
    assert not wrong, wrong


def test_no_modules_import_each_other_in_a_circle():
    graph = {module: {each for each in imports(module) if not is_face(each)} for module in modules()}
    graph = {module: below for module, below in graph.items() if not is_face(module)}
    # Take away what stands on nothing that is left, as long as there is any; what remains is in a circle, or above one.
    while ground := [module for module, below in graph.items() if not below & set(graph)]:
        for module in ground:
            del graph[module]
    assert not graph, sorted(graph)


def floors() -> dict[str, int]:
    """By room, how many rooms stand below each other under it, itself counted; pss, render and scenes are one each."""

    def wide_room(module: str) -> str:
        return room(module) if module.startswith("validate.") else module.partition(".")[0]

    below: dict[str, set[str]] = {}
    for module in modules():
        if not is_face(module):
            below.setdefault(wide_room(module), set()).update(
                wide_room(each) for each in imports(module) if not is_face(each)
            )

    @cache
    def floor(name: str) -> int:
        return 1 + max((floor(each) for each in below[name] - {name}), default=0)

    return {name: floor(name) for name in below}


def test_the_house_is_low():
    """Few rooms, few floors: a newcomer can hold them in mind."""
    found = floors()
    assert max(found.values()) <= MOST_FLOORS, sorted(found.items(), key=lambda each: each[1])
    assert len(found) <= 30
