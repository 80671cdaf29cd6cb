"""How Sphinx makes the site from the pages of this folder: `make docs`.

The pages stay what they are in a repository browser. Links to what the site has no page for, folders and pages outside
of docs, become plain words on the way.
"""

from __future__ import annotations

import importlib.metadata
import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from pss import METRICS  # noqa: E402  (beside a clone that is not installed, its path has to come first)

project = "PSS testbed"
try:
    release = importlib.metadata.version("pss-testbed")
except importlib.metadata.PackageNotFoundError:  # the pages can be built beside a clone that is not installed
    release = ""

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "examples"]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
html_theme = "furo"
html_title = project
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
highlight_language = "none"

# Links such as scenes.md#open-a-view, as a repository browser makes them.
myst_heading_anchors = 3
# The notebook is shown with the outputs that it is stored with; a test runs it (docs/notebook.ipynb).
nb_execution_mode = "off"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
napoleon_numpy_docstring = False
napoleon_use_ivar = False
napoleon_attr_annotations = False
# Names for kinds of arrays, which numpy spells out in a line or two each.
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Floats", "Bools", "BoolArray", "Indices", "Process")}
# What the signatures name and no page of this site describes: types of Python, numpy and of pss' own modules below the
# public names.
nitpick_ignore_regex = [("py:.*", r"(?!pss\.[A-Za-z]\w*$).*")]
# The docstrings write names and formulas between single backticks.
default_role = "code"


def _plain_signs(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """In docstrings |x| is a size and `name_` a name, not substitutions and targets of reStructuredText."""
    for number, line in enumerate(lines):
        outside = line.split("`")
        outside[::2] = [re.sub(r"(\||(?<=\w)_(?!\w))", r"\\\1", text) for text in outside[::2]]
        lines[number] = "`".join(outside)


def _short_kinds(
    app: Sphinx, what: str, name: str, obj: object, options: object, arguments: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Kinds of arrays in signatures by their short names."""

    def short(text: str | None) -> str | None:
        if text is None:
            return None
        text = re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text)
        return re.sub(r"~?[\w.]*ndarray\[tuple\[[^]]*\], ~?[\w.]*dtype\[~?([\w.]+)\]\]", r"NDArray[~\1]", text)

    return short(arguments), short(returns)


def _without_links_to_no_page(app: Sphinx, docname: str, source: list[str]) -> None:
    folder = (HERE / docname).parent

    def plain(match: re.Match[str]) -> str:
        words, target = match.groups()
        goal = (folder / target).resolve()
        page_elsewhere = goal.suffix == ".md" and not goal.is_relative_to(HERE)
        return words if goal.is_dir() or page_elsewhere else match.group()

    source[0] = re.sub(r"(?<!!)\[([^\]]+)\]\(([^)#:]+)(?:#[^)]*)?\)", plain, source[0])


def _without_empty_patterns(app: Sphinx, docname: str, source: list[str]) -> None:
    """Pages of parts that a clone may lack are in the table of contents by pattern."""

    def kept(match: re.Match[str]) -> str:
        return match.group() if any(HERE.glob(f"{match.group(1)}*.md")) else ""

    if docname == "index":
        source[0] = re.sub(r"^(\w+)\*\n", kept, source[0], flags=re.MULTILINE)


def _with_table_of_metrics(app: Sphinx, docname: str, source: list[str]) -> None:
    """The names in `pss.METRICS`, in place of the comment that stands for them."""
    rows = ["| metric | better | from | points that are not observable |", "|---|---|---|---|"]
    for metric in METRICS.values():
        better = "higher" if metric.higher_is_better else "lower"
        cells = (f"`{metric.name}`", better, metric.reference, metric.unobservable)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    source[0] = source[0].replace("<!-- table of metrics -->", "\n".join(rows))


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _without_links_to_no_page)
    app.connect("source-read", _without_empty_patterns)
    app.connect("source-read", _with_table_of_metrics)
    app.connect("autodoc-process-signature", _short_kinds)
    # Before napoleon (500), whose own markup is to stay.
    app.connect("autodoc-process-docstring", _plain_signs, priority=400)
