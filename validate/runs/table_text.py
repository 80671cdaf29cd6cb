"""Rows as text that goes into other documents: CSV, Markdown and LaTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from pss import RangeError
from validate.runs.csv_file import csv_text
from validate.runs.numbers import NOTHING

__all__ = ["TABLE_KINDS", "folded", "markdown_table", "table_text"]

TABLE_KINDS = ("csv", "md", "tex")
"""Comma-separated values, Markdown, LaTeX (tabular with booktabs' rules)."""
# CSV keeps enough digits to distinguish any two measured numbers; a printed table is rounded for reading.
CSV_DIGITS, PRINTED_DIGITS = 7, 4
# What would be code, emphasis, a formula, HTML or a link; a lone bracket is none.
MARKDOWN_SIGNS = re.compile(r"[\\`*$<|]|(?<=\])\(")
TEX_SIGNS = {
    "\\": r"\textbackslash{}",
    **{sign: rf"\{sign}" for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "∞": r"$\infty$",
    "σ": r"$\sigma$",
    "ρ": r"$\rho$",
    "√": r"$\surd$",
    "λ": r"$\lambda$",
    "−": r"$-$",
    "×": r"$\times$",
}


def table_text(rows: Sequence[Mapping[str, object]], kind: str) -> str:
    """The rows as a table with the first row's keys as its head; nan is an empty field, no rows are no text.

    Raises:
        RangeError: a kind that is none of `TABLE_KINDS`.
    """
    if kind not in TABLE_KINDS:
        raise RangeError(f"table {kind!r}; allowed: {', '.join(TABLE_KINDS)}")
    if not rows:
        return ""
    digits = CSV_DIGITS if kind == "csv" else PRINTED_DIGITS
    head = list(rows[0])
    body = [[_field(row.get(key), digits) for key in head] for row in rows]
    numeric = [all(_is_number(row.get(key)) for row in rows) for key in head]
    return {"csv": _csv, "md": _markdown, "tex": _latex}[kind](head, body, numeric)


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool))


def _field(value: object, digits: int) -> str:
    if value is None:
        return ""
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else f"{float(value):.{digits}g}"
    return str(value)


def _csv(head: list[str], body: list[list[str]], _numeric: list[bool]) -> str:
    return csv_text(head, body)


def _markdown(head: list[str], body: list[list[str]], numeric: list[bool]) -> str:
    escaped = [[MARKDOWN_SIGNS.sub(r"\\\g<0>", word.replace("\n", " ")) for word in line] for line in (head, *body)]
    lines = [f"| {' | '.join(line)} |" for line in escaped]
    lines.insert(1, f"|{'|'.join('---:' if right else '---' for right in numeric)}|")
    return "\n".join(lines) + "\n"


def _latex(head: list[str], body: list[list[str]], numeric: list[bool]) -> str:
    lines = [rf"{' & '.join(_tex(word) for word in line)} \\" for line in (head, *body)]
    columns = "".join("r" if right else "l" for right in numeric)
    middle = "\n".join(lines[1:])
    return (
        f"\\begin{{tabular}}{{{columns}}}\n\\toprule\n{lines[0]}\n\\midrule\n{middle}\n\\bottomrule\n\\end{{tabular}}\n"
    )


def _tex(word: str) -> str:
    return "".join(TEX_SIGNS.get(sign, sign) for sign in word.replace("\n", " "))


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; columns in which no row has anything are left out, and it is "" without rows."""
    if not rows:
        return ""
    kept = [place for place in range(len(heads)) if place == 0 or any(row[place] not in ("", NOTHING) for row in rows)]
    lines = [f"| {' | '.join(row[place] for place in kept)} |" for row in (heads, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(kept), *lines[1:]])


def folded(summary: str, body: str) -> str:
    """A part that a browser opens by a click and plain Markdown shows as it is; "" without a body."""
    return f"<details>\n<summary>{summary}</summary>\n\n{body}\n\n</details>" if body else ""
