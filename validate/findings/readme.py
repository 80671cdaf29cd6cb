"""README.md and pages of docs with numbers from tables: what stands between two comments is made anew.

`<!-- numbers: NAME -->` … `<!-- end -->` holds what `BLOCKS[NAME]` makes of the tables in results/reference; on a line
of its own it is a block, within a line it is a part of a sentence.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from pss.errors import RangeError
from render.store.folder import write_text
from validate.findings.blocks_of_banks import BANK_BLOCKS
from validate.findings.blocks_of_docs import DOCS_BLOCKS
from validate.findings.blocks_of_hallway import HALLWAY_BLOCKS
from validate.findings.blocks_of_sweeps import SWEEP_BLOCKS

__all__ = ["BLOCKS", "numbered_pages", "readme_text", "write_pages"]

ROOT = Path(__file__).resolve().parents[2]

BLOCKS: dict[str, Callable[[Path], str]] = {**BANK_BLOCKS, **SWEEP_BLOCKS, **HALLWAY_BLOCKS, **DOCS_BLOCKS}
_NUMBERS = re.compile(r"<!-- numbers: (?P<name>[^>]*?) -->(?P<old>.*?)<!-- end -->", re.DOTALL)


def readme_text(readme: str, reference: Path) -> str:
    """The page with its blocks made from the tables of `reference`; without blocks it is unchanged.

    Raises:
        RangeError: a block of an unknown name, or a comment without its end.
    """

    def made(match: re.Match[str]) -> str:
        name = match["name"]
        if name not in BLOCKS:
            raise RangeError(f"<!-- numbers: {name} -->; allowed: {', '.join(sorted(BLOCKS))}")
        if "<!-- numbers:" in match["old"]:
            raise RangeError(f"<!-- numbers: {name} --> has no <!-- end -->; allowed: one for each")
        text = BLOCKS[name](reference)
        between = f"\n\n{text}\n\n" if match["old"].startswith("\n") else text
        return f"<!-- numbers: {name} -->{between}<!-- end -->"

    text = _NUMBERS.sub(made, readme)
    starts, ends = text.count("<!-- numbers:"), text.count("<!-- end -->")
    if starts != ends:
        raise RangeError(f"{starts} comments <!-- numbers: … --> and {ends} <!-- end -->; allowed: as many of each")
    return text


def numbered_pages(root: Path = ROOT) -> list[Path]:
    """The README and the pages of docs that have blocks."""
    pages = (root / "README.md", *sorted((root / "docs").glob("*.md")))
    return [page for page in pages if page.exists() and "<!-- numbers:" in page.read_text(encoding="utf-8")]


def write_pages(root: Path, reference: Path) -> None:
    """Make the blocks of all pages anew, in place."""
    for page in numbered_pages(root):
        write_text(page, readme_text(page.read_text(encoding="utf-8"), reference))
