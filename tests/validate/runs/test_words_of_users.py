"""Words of users are drawn, printed and shown as they are: no title, name or cell is markup anywhere."""

from __future__ import annotations

import html
import io
import json
import re
import shutil
import warnings
from types import SimpleNamespace

import pytest
from matplotlib.text import Text
from rich.table import Table

from tests.helpers.closet import SCENE, SELECTION, SWEEP
from tests.helpers.layout_of_words import drawable
from tests.helpers.made_up_run import made_up_run
from tests.helpers.pages import Page
from validate.comparison.page import html_of
from validate.comparison.sides import sides_of
from validate.plots import calibration_error, sweep
from validate.plots import pixel_noise as pixel_noise_figure
from validate.plots.glyphs import glyph_runs
from validate.plots.plan import plan_figure
from validate.prediction.foresight import foresee
from validate.run_sweep import main
from validate.runs.console import Console
from validate.runs.file_names import FIGURES
from validate.runs.progress import ViewProgress
from validate.runs.table_text import table_text
from validate.sweeps import summary

# What Matplotlib, rich, HTML, Jinja, plotly, Python's formats, shells and terminals each read as something else.
HOSTILE = (
    "$x_{1$",
    "[/b] Error [mm] over zoom",
    "<script>alert(1)</script>",
    "{{ 7*7 }} %s {0} %{x}",
    "'\"&amp; \\frac :warning:",
    drawable("رؤية 広角 ズーム", "رؤية угол"),
)
TITLE = " ".join(HOSTILE)
# Stems of files: the first is an id that the report's page has for its data, the second a call in a spreadsheet.
STEMS = ("data", "=1+1|[b]<b>$x_{1$")


def titled(text: str, title: str) -> str:
    return re.sub(r"^title = .*$", lambda _: f"title = {json.dumps(title, ensure_ascii=False)}", text, flags=re.M)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A made-up run of two sweeps whose names and titles are hostile."""
    folder = tmp_path_factory.mktemp("words")
    sweeps = dict(zip(STEMS, (titled(SWEEP, TITLE), titled(SELECTION, TITLE)), strict=True))
    results, acquired, store = made_up_run(folder, SCENE, sweeps)
    return SimpleNamespace(folder=folder, out=folder / "run", results=results, acquired=acquired, store=store)


def drawn_words(figure) -> list[str]:
    """Every text of a figure, as Matplotlib draws it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # signs that the font lacks
        figure.canvas.draw()
    texts = [text for text in figure.findobj(Text) if text.get_text()]
    assert not [text.get_text() for text in texts if text.get_parse_math()]
    return [text.get_text() for text in texts]


def printed(show) -> str:
    """What a function prints on a wide console."""
    console = Console(file=io.StringIO(), width=400)
    show(console)
    return console.file.getvalue()


# ---- figures -----------------------------------------------------------------------------------------------------


def test_figures_have_the_title_as_it_is(made):
    """But for breaks of lines, and letters that no font of this machine has, which are written by number."""
    result = made.results[0]
    title = "".join(words for _, words in glyph_runs(TITLE))
    assert title.startswith(" ".join(HOSTILE[:-1]))
    for figure, words in (
        (sweep.sweep_figure, title),
        (sweep.points_figure, f"{title}: single-frame error of each point"),
    ):
        assert words in [" ".join(drawn.split()) for drawn in drawn_words(figure(result))]


def test_every_figure_of_a_run_is_written(made):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        drawn = sweep.draw_all(made.out, made.results[1:], made.store)
    assert [path.name for path in drawn] == [f"{STEMS[1]}{suffix}.png" for suffix in FIGURES]


def test_the_plan_of_a_scene_has_its_name_as_it_is(made):
    import scenes

    path = made.folder / "$x_{1$ [b].toml"
    path.write_text(SCENE)
    assert any(path.name in words for words in drawn_words(plan_figure(foresee(scenes.load(path)))))


def test_logarithmic_axes_have_plain_numbers():
    """Without formulas the default labels of logarithmic axes would be drawn as source: $\\mathdefault{10^{0}}$."""
    columns = [f"{name}{end}_px" for name in ("sigma", "bias") for end in ("", "_low", "_high")]
    rows = [
        {"module_px": x, "bound_sigma_px": 0.01 / x, "physical_sigma_px": 0.01 / x} | dict.fromkeys(columns, 0.01 / x)
        for x in (1.0, 10.0, 100.0)
    ]
    figure, axes = sweep.plt.subplots()
    pixel_noise_figure._noise(axes, rows, "module_px")
    assert not [words for words in drawn_words(figure) if "$" in words]
    assert calibration_error.plt is sweep.plt


# ---- console -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("words", HOSTILE)
def test_the_console_prints_words_as_they_are(words):
    table = Table(title=words)
    table.add_column(words)
    table.add_row(words)
    assert printed(lambda console: console.print(table)).count(words) == 3
    assert printed(lambda console: console.print(words)) == f"{words}\n"


def test_the_console_sends_no_sequence_of_a_file_to_the_terminal():
    assert printed(lambda console: console.print("a\x1b]0;title\x07b")) == "a\\x1b]0;title\\x07b\n"


def test_a_mistake_sends_no_sequence_of_a_file_to_the_terminal(tmp_path, capsys):
    record = {"options": {"sweeps": "()", "store": "\x1b]0;title\x07"}, "sweeps": {}, "scenes": {}}
    (tmp_path / "run.json").write_text(json.dumps(record))
    assert main(["report", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert "\\x1b]0;title\\x07" in message
    assert message.strip().isprintable()


def test_a_pipe_that_nobody_reads_is_the_same_error_as_of_print():
    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        Console(file=Closed()).print("a")


def test_markdown_has_words_as_they_are():
    """No HTML, formula, code, emphasis or link; intervals keep their brackets."""
    table = table_text([{"a": "<b>$x$ `c` *d* [e](f) | \\g"}, {"a": "0.5 [0.1, 0.9]"}], "md")
    assert table.splitlines()[2:] == [r"| \<b>\$x\$ \`c\` \*d\* [e]\(f) \| \\g |", "| 0.5 [0.1, 0.9] |"]


def test_the_bar_of_progress_takes_any_name():
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with ViewProgress(2, console) as progress:
        progress.advance("measured camera [/b]")
        assert progress._bar is not None
        progress._bar.refresh()
    assert "measured camera [/b]" in console.file.getvalue()


def test_the_tables_of_a_run_name_its_sweeps_as_they_are(made):
    record = printed(lambda console: summary.show(made.results, made.acquired, console))
    assert record.count(STEMS[1]) > 5


def test_a_comparison_prints_settings_as_they_are(made, capsys):
    runs = []
    for number, title in enumerate((TITLE, "Error [mm] over zoom")):
        run = made.folder / f"<b>run[{number}]"
        shutil.copytree(made.out, run)
        record = {"options": {}, "sweeps": {"data": {"title": title}}, "scenes": {"data": {}}}
        (run / "run.json").write_text(json.dumps(record))
        runs.append(str(run))
    assert main(["compare", *runs, "--no-report"]) == 0
    output = re.sub(r"[\s│┃]+", "", capsys.readouterr().out)
    assert "Error[mm]overzoom" in output
    assert "[/b]" in output
    page = Page(html_of(sides_of(runs)))
    assert_no_more_elements(page)


# ---- pages -------------------------------------------------------------------------------------------------------


def assert_no_more_elements(page: Page) -> None:
    """Scripts are the page's own, and no two elements have one id."""
    assert len(page.all("script")) == 3
    ids = [element.attributes["id"] for element in page.elements if "id" in element.attributes]
    assert len(ids) == len(set(ids))
    links = [element.attributes["href"] for element in page.all("a")]
    assert {link.removeprefix("#") for link in links if link.startswith("#")} <= set(ids)


def test_the_report_shows_words_as_they_are(made):
    text = (made.out / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert_no_more_elements(page)
    assert [element.tag for element in page.elements if element.attributes.get("id") == "data"] == ["script"]
    assert STEMS[1] in [element.text.strip() for element in page.elements]
    assert html.unescape(text).count(TITLE) == len(STEMS)
    assert TITLE not in text
