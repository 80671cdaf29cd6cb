"""Digests of the code behind a result, as part of the result's name, so that results of other code are never used.

A digest covers all modules that an entry module imports, directly or not, within this project: new helper modules are
included automatically, and no version has to be raised by hand. Imports from a package that only re-exports names
(`from pss import PTZCamera`) lead to the modules that define them and to no others. Imports under TYPE_CHECKING are
skipped.

Only a module's syntax tree without docstrings counts, in a form that is the same for all versions of Python: comments,
docstrings and layout have no effect. The versions of the libraries that these modules import count as well.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

__all__ = ["DIGITS", "Code", "code_of", "installed_version"]

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("pss", "render", "scenes", "validate")
# Hexadecimal digits of a digest: among a thousand versions of the code, two collide with probability 1e-4.
DIGITS = 8
# Distributions of libraries whose names differ from the library's; the first that is installed counts.
DISTRIBUTIONS = {
    "cv2": (
        "opencv-contrib-python-headless",
        "opencv-contrib-python",
        "opencv-python-headless",
        "opencv-python",
    ),
    "PIL": ("pillow",),
    "mpl_toolkits": ("matplotlib",),
}
# Fields of Python's syntax tree that do not affect the code's behaviour.
WITHOUT_MEANING = {"ctx", "kind", "type_comment"}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass(frozen=True)
class Code:
    """The code behind one kind of result.

    Attributes:
        modules: names of the project's modules, in alphabetical order.
        libraries: (name, version) of each library that they import.
        digest: `DIGITS` hexadecimal digits, of the modules' syntax and the libraries' versions.
    """

    modules: tuple[str, ...]
    libraries: tuple[tuple[str, str], ...]
    digest: str


def code_of(*entries: str, excluded: tuple[str, ...] = (), root: Path = ROOT) -> Code:
    """The code of the modules `entries` and of all that they import; sources are read once per process.

    Args:
        entries: names of modules of the project.
        excluded: modules and libraries that do not count, nor the imports that only they have.
        root: the folder of the project's packages.

    Raises:
        FileNotFoundError: an entry, or an imported module, has no source file.
    """
    reached = _reached(entries, excluded, root)
    libraries = tuple((name, installed_version(name)) for name in reached.libraries)
    content = hashlib.sha256(f"{libraries}\n{reached.digest}".encode())
    return Code(reached.modules, libraries, content.hexdigest()[:DIGITS])


@cache
def installed_version(library: str) -> str:
    """Version of a library's distribution, "none" if it is not installed; the library is not imported."""
    for name in DISTRIBUTIONS.get(library, (library,)):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "none"


# ---- which modules ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Reached:
    modules: tuple[str, ...]
    libraries: tuple[str, ...]
    digest: str


@cache
def _reached(entries: tuple[str, ...], excluded: tuple[str, ...], root: Path) -> _Reached:
    sources = _Sources(root)
    seen: set[str] = set()
    libraries: set[str] = set()
    waiting = list(entries)
    while waiting:
        name = waiting.pop()
        if name in seen or name in excluded:
            continue
        top = name.partition(".")[0]
        if top not in PACKAGES:
            if top not in sys.stdlib_module_names and top not in excluded:
                libraries.add(top)
            continue
        seen.add(name)
        parents = [name[:at] for at, character in enumerate(name) if character == "."]
        waiting += [parent for parent in parents if not sources.module(parent).only_reexports]
        waiting += [sources.defined_in(*imported) for imported in sources.module(name).imports]
    modules = tuple(sorted(seen))
    content = hashlib.sha256()
    for name in modules:
        content.update(f"{name} {sources.module(name).digest}\n".encode())
    return _Reached(modules, tuple(sorted(libraries)), content.hexdigest())


class _Sources:
    """The project's source files in a folder."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._modules: dict[str, _Module] = {}

    def module(self, name: str) -> _Module:
        """Digest, imports and re-exports of a module or a package."""
        if name not in self._modules:
            folder = self._root.joinpath(*name.split("."))
            path = folder / "__init__.py" if self._is_package(name) else folder.with_suffix(".py")
            self._modules[name] = _parsed(path.read_bytes())
        return self._modules[name]

    def defined_in(self, module: str, name: str) -> str:
        """The module that `from module import name` refers to: a submodule, or the origin of a package's re-export."""
        if not name or module.partition(".")[0] not in PACKAGES:
            return module
        if self._exists(f"{module}.{name}"):
            return f"{module}.{name}"
        reexports = dict(self.module(module).reexports) if self._is_package(module) else {}
        return self.defined_in(*reexports[name]) if name in reexports else module

    def _is_package(self, name: str) -> bool:
        return (self._root.joinpath(*name.split(".")) / "__init__.py").is_file()

    def _exists(self, name: str) -> bool:
        return self._is_package(name) or self._root.joinpath(*name.split(".")).with_suffix(".py").is_file()


# ---- one module ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Module:
    """A source file: its digest, (module, name or "") of its imports, and its re-exported names."""

    digest: str
    imports: tuple[tuple[str, str], ...]
    reexports: tuple[tuple[str, tuple[str, str]], ...]
    only_reexports: bool


@cache
def _parsed(source: bytes) -> _Module:
    tree = ast.parse(source)
    imports: list[tuple[str, str]] = []
    parts: list[str] = []
    _collect(tree, parts, imports)
    checked = [part for part in tree.body if isinstance(part, ast.If) and _is_for_types(part.test)]
    reexports = {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in [*tree.body, *(node for part in checked for node in part.body)]
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    return _Module(
        hashlib.sha256("\0".join(parts).encode()).hexdigest(),
        tuple(dict.fromkeys(imports)),
        tuple(reexports.items()),
        all(_is_reexport(statement) for statement in tree.body),
    )


def _is_reexport(statement: ast.stmt) -> bool:
    """Whether a statement is an import, a docstring or `__all__`, or re-exports names at their first use."""
    if isinstance(statement, ast.FunctionDef):
        return statement.name in ("__getattr__", "__dir__")
    if isinstance(statement, ast.If):
        return _is_for_types(statement.test)
    if isinstance(statement, ast.Assign):
        return [ast.unparse(target) for target in statement.targets] == ["__all__"]
    return isinstance(statement, ast.Import | ast.ImportFrom) or (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    )


def _collect(node: object, parts: list[str], imports: list[tuple[str, str]]) -> None:
    """Append the parts of a syntax tree to `parts`, and its imports to `imports`.

    Empty fields are skipped, since they differ between versions of Python (`type_params`).
    """
    if isinstance(node, list):
        parts.append("[")
        for item in node:
            _collect(item, parts, imports)
        parts.append("]")
    elif isinstance(node, ast.AST):
        _note_imports(node, imports)
        parts.append(type(node).__name__)
        for name in node._fields:
            value = getattr(node, name, None)
            if name == "body" and isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
                value = value[1:]
            if isinstance(node, ast.JoinedStr):
                # Some versions of Python put empty strings between the values of an f-string.
                value = [part for part in value if not (isinstance(part, ast.Constant) and part.value == "")]
            if value is None or value == [] or name in WITHOUT_MEANING:
                continue
            parts.append(name)
            if name == "body" and isinstance(node, ast.If) and _is_for_types(node.test):
                _collect(value, parts, [])
            else:
                _collect(value, parts, imports)
        parts.append(")")
    else:
        parts.append(repr(node))


def _is_for_types(test: ast.expr) -> bool:
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"


def _note_imports(node: ast.AST, imports: list[tuple[str, str]]) -> None:
    if isinstance(node, ast.Import):
        imports.extend((alias.name, "") for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        if node.level:
            raise ValueError(f"line {node.lineno} imports relatively; allowed: absolute imports")
        imports.extend((node.module or "", alias.name) for alias in node.names)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
        called = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
        if called in ("__import__", "import_module") and node.args and isinstance(node.args[0], ast.Constant):
            imports.append((str(node.args[0].value), ""))
