"""The fenced blocks of README, CONTRIBUTING and docs, with the comment that says how one is to be treated."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")))
BLOCK = re.compile(
    r"(?:^<!-- block: (?P<treatment>[^\n]*?) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True)
class Block:
    """A fenced block; `treatment` is what the comment before it says ("" if there is none), `output` the text block
    that follows a block of Python, if nothing is between them."""

    page: str
    number: int
    language: str
    text: str
    treatment: str
    output: str | None = None

    def __str__(self) -> str:
        return f"{self.page}-{self.number}"


def blocks_of(page: Path) -> list[Block]:
    """The blocks of a page in order."""
    text = page.read_text(encoding="utf-8")
    found = list(BLOCK.finditer(text))
    blocks = []
    for number, (match, after) in enumerate(zip(found, [*found, None][1:], strict=True), start=1):
        printed = None
        if match["language"] == "python" and after is not None and after["language"] == "text":
            printed = after["text"] if not text[match.end() : after.start()].strip() else None
        name = page.relative_to(ROOT).as_posix()
        blocks.append(Block(name, number, match["language"], match["text"], match["treatment"] or "", printed))
    return blocks


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def shell_lines() -> dict[str, str]:
    """Each line of the `sh` blocks, comments left out and continued lines joined, with the page that has it first.

    Without those of docs/commands.md, which stand on each other: tests/docs/test_commands_doc.py runs them in their
    order.
    """
    lines: dict[str, str] = {}
    for block in BLOCKS:
        if block.language == "sh" and block.page != "docs/commands.md":
            for line in block.text.replace("\\\n", " ").splitlines():
                words = shlex.split(line, comments=True)
                if words:
                    lines.setdefault(shlex.join(words).replace("'>'", ">"), block.page)
    return lines


def toml(value: object) -> str:
    """A value as TOML, tables inline; the whole of a file if `value` is a table of tables."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f'"{key}" = {toml(item)}' for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return '"' + value + '"' if isinstance(value, str) else repr(value)


def toml_file(document: dict[str, object]) -> str:
    """A TOML document, a line for each key."""
    return "".join(f"{key} = {toml(value)}\n" for key, value in document.items())
