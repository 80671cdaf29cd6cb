"""`python -m validate.findings`: docs/findings.md, its figures and README's numbers, from results/reference."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro

from render.store.folder import write_text
from validate.findings.figures import drawings_of, write_pdf, write_svg
from validate.findings.page import findings_page
from validate.findings.places import places_of_reference
from validate.findings.readme import write_pages
from validate.runs.exit_codes import EXIT_DONE, EXIT_MISTAKE

ROOT = Path(__file__).resolve().parents[2]


def run(
    write: bool = False,
    pdf: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None,
    reference: Annotated[Path, tyro.conf.arg(metavar="DIR")] = ROOT / "results" / "reference",
    docs: Annotated[Path, tyro.conf.arg(metavar="DIR")] = ROOT / "docs",
) -> int:
    """Make the page of findings from tables; without options it is printed.

    Args:
        write: write findings.md and figures/findings-*.svg into the folder of docs, and the numbers of the other pages
            and of the README beside it.
        pdf: write the figures as PDF, 7 inches wide, for a paper.
        reference: folder of the tables.
        docs: folder of the page.
    """
    if not reference.is_dir():
        print(f"{reference}: no such folder; allowed: one with the tables of runs", file=sys.stderr)
        return EXIT_MISTAKE
    page = findings_page(reference)
    drawings = drawings_of(places_of_reference(reference))
    if write:
        write_text(docs / "findings.md", page)
        for drawing in drawings:
            write_svg(drawing, docs / "figures")
        write_pages(docs.parent, reference)
    if pdf is not None:
        pdf.mkdir(parents=True, exist_ok=True)
        for drawing in drawings:
            write_pdf(drawing, pdf)
    if not write and pdf is None:
        print(page, end="")
    return EXIT_DONE


if __name__ == "__main__":
    sys.exit(tyro.cli(run, prog="python -m validate.findings"))
