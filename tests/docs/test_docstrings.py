"""Public names of pss: each has a docstring, and one that gives arrays says their shape."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ARRAYS = ("Floats", "Bools", "Indices", "Integers", "Images", "Pixels", "NDArray")
# A shape is a tuple of axes, as Python prints it: (N,) has the comma, and (...) stands for any number of axes.
AXIS = r"(?:\.\.\.|[A-Za-z]|\d+[a-z]?|[a-z]·[a-z]|count|most)"
SHAPE = re.compile(rf"\({AXIS}(?:(?:, {AXIS})+|,)\)|\(\.\.\.\)|\bshape\b")
MODULES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "pss").rglob("*.py"))
# What the docstring of the class says of all its arrays.
CLASS_WIDE = {
    "Views": "Arrays are (C, N)",
    "Cameras": "as arrays",
    "PixelCovariance": "arrays that broadcast to (C, N)",
}


def public(module: str) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef, ast.ClassDef | None]]:
    """The public functions, classes and methods of a module, by qualified name, with the class of a method."""
    for node in ast.parse((ROOT / module).read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
            continue
        yield node.name, node, None
        if isinstance(node, ast.ClassDef):
            for member in node.body:
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                    yield f"{node.name}.{member.name}", member, node


@pytest.mark.parametrize("module", MODULES)
def test_public_names_have_docstrings_and_arrays_have_shapes(module):
    wanting = []
    for name, node, owner in public(module):
        text = ast.get_docstring(node)
        if not text:
            wanting.append(f"{name}: no docstring")
            continue
        if isinstance(node, ast.ClassDef) or node.returns is None:
            continue
        returns = ast.unparse(node.returns)
        described = SHAPE.search(text) or (owner is not None and owner.name in CLASS_WIDE)
        if any(kind in returns for kind in ARRAYS) and not described:
            wanting.append(f"{name}: returns {returns}, gives no shape")
    assert not wanting, wanting


@pytest.mark.parametrize(
    "text", ["(N,)", "(C, N)", "(..., 3)", "(...)", "(N, 3d, 3d)", "(..., n·m, n)", "of any shape"]
)
def test_shapes_are_recognised(text):
    assert SHAPE.search(f"Points, {text}, in m.")


@pytest.mark.parametrize(
    "text", ["(Eq. 4)", "(C)", "(x right, y down)", "(I + Lᵀ J L)", "(depth 0)", "(a, b and c)", "N"]
)
def test_other_brackets_are_no_shapes(text):
    assert not SHAPE.search(f"Points, {text}, in m.")


def test_class_wide_statements_are_there():
    classes = {name: node for module in MODULES for name, node, _ in public(module) if isinstance(node, ast.ClassDef)}
    for name, words in CLASS_WIDE.items():
        assert words in (ast.get_docstring(classes[name]) or ""), name
