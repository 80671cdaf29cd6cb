"""The rules of the house, read off the source: who imports whom, where randomness comes from, what is not written down.

Each rule has an allow-list; an entry without a reason, or one that is no longer needed, fails.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import pss
import render
import scenes
import validate
from tests.helpers.processes import environment
from tests.helpers.sources import PACKAGES, ROOT, imports, modules, relative, tree

RENDERER = {"mitsuba", "drjit"}

# (file, import): why it may.
ALLOWED = {
    ("render/world/marker_print.py", "cv2"): "prints the modules of OpenCV's own dictionaries",
    (
        "render/backend.py",
        "mitsuba",
    ): "starts the variant, after it has chosen a libLLVM; all others get the module from it",
    ("render/store/remote.py", "fsspec"): "opens a store at an address, with the extra `cloud`; a folder needs none",
    ("render/backend.py", "archspec"): "asks for the kind of processor, on which the last bits of a render hang",
    ("render/backend.py", "drjit"): "sets how many threads render, after the variant has started",
    (
        "render/lens/thin_lens.py",
        "drjit",
    ): "makes settings data of the compiled code; runs after the backend has started",
    ("render/lens/sampling.py", "drjit"): "sums samples into pixels; runs after the backend has started",
    ("render/light/emission.py", "drjit"): "looks up what surfaces send back; runs after the backend has started",
    ("render/lens/lens_effects.py", "drjit"): "bends and blurs where samples go; runs after the backend has started",
    ("render/renderer.py", "drjit"): "casts the rays for depth and normals; runs after the backend has started",
}
# What each package may import besides the standard library and itself; None: anything that the rules below leave.
MAY_IMPORT: dict[str, set[str] | None] = {
    "pss": {"numpy", "scipy", "trimesh"},
    "render": {"pss", "numpy", "scipy", "trimesh", "OpenImageIO"},
    "scenes": {"pss", "render", "numpy", "pydantic", "pydantic_core"},
    "validate": None,
}
# The parts of numpy.random that hold no state of the whole process.
STATELESS_RANDOM = {"Generator", "SeedSequence", "default_rng", "BitGenerator", "PCG64", "Philox"}
ALLOWED_RANDOM = {("tests/render/test_sensor.py", "get_state"): "shows that the global state stays untouched"}
# Absolute places of one machine. Written so that this line does not match itself.
MACHINE_PATH = re.compile(r"(?<![\w.~-])/(?:work|tmp|root|home/\w+|Users/\w+)(?=[/\s\"'`),;:]|$)", re.MULTILINE)
TEXT_SUFFIXES = {".py", ".toml", ".md", ".txt", ".cfg", ".yml", ".yaml", ".lock", ".csv", ".json", ".html", ".sh", ""}
TEXT_SUFFIXES |= {".ipynb", ".css"}
GENERATED = {"build", "_build", "dist", "__pycache__", "results"}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_what_its_layer_may(package):
    """pss: numpy, scipy, trimesh. render: nothing of validate or scenes. scenes: nothing of validate, no renderer."""
    may, wrong = MAY_IMPORT[package], []
    for path in modules(package):
        for name, node in imports(path):
            top = name.partition(".")[0]
            if top == package or top in sys.stdlib_module_names or (relative(path), top) in ALLOWED:
                continue
            if (may is not None and top not in may) or top in RENDERER:
                wrong.append(f"{relative(path)}:{node.lineno} imports {name}")
    assert not wrong, wrong


def test_what_is_allowed_is_needed_and_has_a_reason():
    for (file, name), reason in ALLOWED.items():
        assert name in {imported.partition(".")[0] for imported, _ in imports(ROOT / file)}, (file, name)
        assert len(reason) > 20


# (import, the one file of the packages that has it): what the file does for all others.
ONE_DOOR = {
    ("csv", "validate/runs/csv_file.py"): "keeps cells from being formulas, and knows the old names of columns",
    ("rich.console", "validate/runs/console.py"): "prints words of users as they are, never as markup",
    ("matplotlib.pyplot", "validate/plots/drawing.py"): "draws words of users as they are, never as formulas",
}


@pytest.mark.parametrize(("name", "door"), ONE_DOOR)
def test_some_libraries_are_imported_by_one_file(name, door):
    found = {relative(path) for path in modules(*PACKAGES) for imported, _ in imports(path) if imported == name}
    assert found == {door}, ONE_DOOR[name, door]


# (file, function that calls json.dumps): why it may.
JSON_WRITERS = {
    ("pss/json_text.py", "json_text"): "is the writer",
    ("pss/toml_text.py", "_quoted"): "escapes a text for TOML",
    ("render/keys.py", "digest_of"): "hashes the text, and nobody reads it",
    ("scenes/errors.py", "_as_toml"): "shows a value in a message",
}


def test_json_has_one_writer():
    """Whoever calls `json.dumps` itself is listed with a reason."""
    found = set()
    for path in modules(*PACKAGES):
        if "json" in {name for name, _ in imports(path)}:
            for function in ast.walk(tree(path)):
                if isinstance(function, ast.FunctionDef):
                    for node in ast.walk(function):
                        if isinstance(node, ast.Attribute) and ast.unparse(node) in ("json.dumps", "json.dump"):
                            found.add((relative(path), function.name))
    assert found == set(JSON_WRITERS)


def test_no_test_module_imports_another():
    """What several of them need is a fixture in a conftest, or in tests/helpers."""
    for path in modules("tests"):
        for name, node in imports(path):
            names = [name, *(alias.name for alias in getattr(node, "names", ()))]
            assert not any(part.startswith("test_") for name in names for part in name.split(".")), (
                f"{relative(path)}:{node.lineno} imports {name}; allowed: conftest.py and tests/helpers"
            )


def test_mitsuba_is_imported_inside_functions_only():
    """Dr.Jit looks for libLLVM at its first import, which therefore must not happen before one is chosen."""
    for path in modules(*PACKAGES):
        top_level = set(tree(path).body)
        for name, node in imports(path):
            assert name.partition(".")[0] not in RENDERER or node not in top_level, f"{relative(path)}:{node.lineno}"


@pytest.mark.parametrize(
    ("imported", "absent"),
    [
        ("pss", ["mitsuba", "drjit", "cv2", "OpenImageIO", "matplotlib", "render", "scenes", "validate"]),
        ("scenes", ["mitsuba", "drjit", "cv2", "matplotlib", "validate"]),
        ("render.renderer, render.files.exr", ["mitsuba", "drjit", "scenes", "validate"]),
    ],
)
def test_importing_a_layer_loads_nothing_of_the_layers_above(imported, absent):
    """Asked in a process of its own, where nothing is loaded yet."""
    script = f"import {imported}, sys; print(*[name for name in {absent!r} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        env=environment(),
        timeout=120,
    )
    assert done.stdout.split() == []


def test_no_module_of_validate_hides_one_of_the_standard_library():
    """A script in validate/ runs with that folder first on sys.path."""
    names = {path.stem for path in (ROOT / "validate").glob("*.py")} | {
        path.name for path in (ROOT / "validate").iterdir() if path.is_dir()
    }
    names -= {"__init__", "__pycache__"}
    assert not names & set(sys.stdlib_module_names)
    # Nor one that validate itself imports from elsewhere.
    outside = {name.partition(".")[0] for path in modules("validate") for name, _ in imports(path)} - {"validate"}
    assert not names & outside


@pytest.mark.parametrize("package", [pss, render, scenes, validate], ids=lambda package: package.__name__)
def test_the_packages_are_ours(package):
    """`configobj` on PyPI also ships a top-level package called validate."""
    assert Path(package.__file__).resolve() == ROOT / package.__name__ / "__init__.py"


def random_uses(path: Path) -> Iterator[tuple[str, int]]:
    """Names taken from numpy.random (by any alias) and uses of the standard library's random."""
    module, aliases, numpies = tree(path), set(), set()
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name == "random":
                    yield "random", node.lineno
                if alias.name == "numpy":
                    numpies.add(alias.asname or "numpy")
                if alias.name == "numpy.random":
                    aliases.add(alias.asname or "numpy.random")
        elif isinstance(node, ast.ImportFrom):
            if node.module == "random":
                yield "random", node.lineno
            if node.module == "numpy.random":
                yield from ((alias.name, node.lineno) for alias in node.names)
            if node.module == "numpy":
                aliases |= {alias.asname or alias.name for alias in node.names if alias.name == "random"}
    for node in ast.walk(module):
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if owner in aliases or owner in {f"{name}.random" for name in numpies}:
                yield node.attr, node.lineno


@pytest.mark.parametrize("folder", [*PACKAGES, "tests", "benchmarks"])
def test_no_global_random_state(folder):
    """Randomness comes from numpy.random.Generator objects that are handed on; nothing seeds or draws globally."""
    used = [(relative(path), name, line) for path in modules(folder) for name, line in random_uses(path)]
    wrong = [use for use in used if use[1] not in STATELESS_RANDOM and use[:2] not in ALLOWED_RANDOM]
    assert not wrong, wrong
    allowed = {use for use in ALLOWED_RANDOM if use[0].startswith(f"{folder}/")}
    assert allowed <= {use[:2] for use in used}


@pytest.mark.parametrize("package", [*PACKAGES, "benchmarks"])
def test_every_generator_is_seeded(package):
    """`default_rng()` without a seed gives other numbers in each run."""
    for path in modules(package):
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in (
                "default_rng",
                "SeedSequence",
            ):
                assert node.args or node.keywords, f"{relative(path)}:{node.lineno}"


def texts() -> list[Path]:
    """Sources and docs, without what git ignores and what a run leaves (but for results/reference)."""
    found = [path for path in (ROOT / "results" / "reference").rglob("*") if path.is_file()]
    for path in ROOT.rglob("*"):
        parts = path.relative_to(ROOT).parts
        hidden = any(part.startswith(".") and part not in (".ci", ".github", ".gitignore") for part in parts)
        if path.is_file() and not hidden and not GENERATED & set(parts) and not parts[0].endswith(".egg-info"):
            found.append(path)
    return [path for path in found if path.suffix in TEXT_SUFFIXES]


def test_no_path_of_one_machine_is_written_down():
    wrong = []
    for path in texts():
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
            if MACHINE_PATH.search(line):
                wrong.append(f"{relative(path)}:{number}: {line.strip()[:100]}")
    assert not wrong, wrong


@pytest.mark.parametrize("folder", ["work", "tmp", "root", "home/me", "Users/me"])
def test_the_search_for_paths_finds_them_and_nothing_else(folder):
    for text in (f'"/{folder}/x.exr"', f"see /{folder}", f"in `/{folder}/a`", f"(/{folder})"):
        assert MACHINE_PATH.search(text), text
    for text in (f"https://example.org/{folder}/x", f"a/{folder}/b", f"./{folder}/x", f"../{folder}"):
        assert not MACHINE_PATH.search(text), text
    assert not MACHINE_PATH.search("/workbench /tmpfs /rooted /homely/me")


def test_every_module_says_what_it_is_for():
    for path in modules(*PACKAGES):
        assert ast.get_docstring(tree(path)), relative(path)
