"""docs/findings.md and its figures give what the tables in results/reference hold, to the letter."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.made_up_reference import MODELS, PLACES, write_reference
from validate.findings.__main__ import run
from validate.findings.bank import bank_findings
from validate.findings.budget import budget_findings
from validate.findings.contenders import CONTENDERS, contenders_in
from validate.findings.factors import factor_findings
from validate.findings.figures import DIGEST, drawings_of, write_pdf, write_svg
from validate.findings.page import findings_page
from validate.findings.places import places_of_reference
from validate.findings.ranking_tables import neutral_table
from validate.findings.sentences import five_sentences
from validate.runs.csv_file import csv_text, read_tables
from validate.runs.numbers import in_powers, with_range
from validate.runs.table_text import markdown_table

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
REFERENCE = ROOT / "results" / "reference"
NUMBER_WITH_INTERVAL = r"−?\d+\.\d+ \[−?\d+\.\d+, −?\d+\.\d+\]"


@pytest.fixture(scope="module")
def made_up(tmp_path_factory):
    """A reference folder with every table that findings are made of."""
    return write_reference(tmp_path_factory.mktemp("reference"))


@pytest.fixture
def copy(made_up, tmp_path):
    """The same, to be changed."""
    return Path(shutil.copytree(made_up, tmp_path / "reference"))


def changed(path: Path, change) -> None:
    """Rewrite a table with `change` applied to each row; rows it returns None for go."""
    rows = [row for row in map(change, read_tables(path.parent)[path.stem]) if row is not None]
    head = list(dict.fromkeys(key for row in rows for key in row))
    path.write_text(csv_text(head, [[row[key] for key in head] for row in rows]), encoding="utf-8")


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_page_is_made_from_the_tables():
    """`python -m validate.findings --write` changes nothing."""
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert page == findings_page(REFERENCE)
    assert not re.search(r"^- ", page, re.MULTILINE)
    for heading in ("One factor at a time", "Where the sweeps' errors are from", "If the calibration is wrong"):
        assert f"### {heading}" in page


def digest_in(path):
    """The digest that an SVG file of `write_svg` was made from."""
    _, found, rest = path.read_text(encoding="utf-8").partition(DIGEST)
    assert found
    return rest[:16]


def test_the_figures_of_the_page_show_the_numbers_of_the_tables():
    """Each holds the digest of the numbers it was drawn from; none is left of an earlier page."""
    drawings = drawings_of(places_of_reference(REFERENCE))
    assert drawings
    figures = ROOT / "docs" / "figures"
    assert {path.name for path in figures.glob("findings-*")} == {drawing.file for drawing in drawings}
    assert {drawing.file: digest_in(figures / drawing.file) for drawing in drawings} == {
        drawing.file: drawing.digest for drawing in drawings
    }


def test_the_page_opens_with_five_sentences_then_figures_then_tables(made_up):
    page = findings_page(made_up)
    numbered = re.findall(r"^(\d)\. \*\*(.+?)\*\* (.+)$", page, re.MULTILINE)
    assert [number for number, *_ in numbered] == ["1", "2", "3", "4", "5"]
    assert all(re.search(NUMBER_WITH_INTERVAL, numbers) for *_, numbers in numbered)
    (population,) = re.findall(r"^\*Population of all, unless named:\* (.+)$", page, re.MULTILINE)
    for condition in ("500 configurations of four cameras in each of 6 cases: three rooms, one of them in four lights",
                      "the room's seven, the atrium's six, the studio's seven camera places",
                      "70 held-out views rendered twice (room, atrium, studio, room at 30 × light)",
                      "70 held-out views rendered once (room at ¼ light, room at 4 × light)",
                      "registered markers", "dim light", "perfect calibration", "a closed world"):  # fmt: skip
        assert condition in population
    assert "*Population of the second half: 500 configurations of four cameras in the room, by" in numbered[-1][2]
    assert page.index("5. **") < page.index("*Population") < page.index("## Figures") < page.index("## Tables")
    before_tables = page.partition("## Tables")[0]
    assert not re.search(r"^- ", before_tables, re.MULTILINE)


def test_every_contender_is_in_every_table_in_every_place(made_up):
    """Of ranking, differences, regret and NEES: a row for each R with a number in each place's column."""
    page = findings_page(made_up)
    for title in ("How well does it rank?", "What does choosing by it cost?", "Is the error as large as predicted?"):
        section = page.partition(f"### {title}")[2].partition("\n\n</details>")[0]
        lines = section.strip().splitlines()
        table = [line for line in lines if line.startswith("|")]
        head = [cell.strip() for cell in table[0].strip("|").split("|")]
        assert len([cell for cell in head if cell.startswith(("room", "atrium", "studio"))]) == len(PLACES)
        for model in MODELS:
            rows = [line for line in table if f"| {model} |" in line]
            assert rows, (title, model)
            assert all(len(re.findall(r"\d", cell)) for line in rows for cell in line.strip("|").split("|")[2:]), model


def test_the_studio_is_named_with_its_commits(copy):
    words = "The studio is prospective, frozen in commit `0123abc` and judged in commit `4567def`: ρ = 0.96"
    assert words in findings_page(copy)
    (copy / "bank-third" / "commits.csv").unlink()
    assert "prospective" not in findings_page(copy)


@pytest.mark.parametrize(
    "gone",
    ["bank-third", "bank-dim", "bank", "calibration_error.csv", "bank/process.csv", "bank/size.csv", "bank/ceiling.csv",
     "bank/leaderboard.csv", "bank/consistency.csv", "bank/differences.csv", "bank/blunders.csv"],
)  # fmt: skip
def test_what_is_missing_is_left_out(copy, gone):
    path = copy / gone
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    page = findings_page(copy)
    assert "nan" not in re.sub(r"\w*nan\w+|\w+nan\w*", "", page)
    assert drawings_of(places_of_reference(copy))


def test_missing_columns_are_left_out(copy):
    """Tables of an earlier version have no intervals of regret and no oracle's mean."""

    def without(row):
        return {
            key: value for key, value in row.items() if not re.match(r"(oracle_)?regret.*(_ci_|mean_ci)|oracle", key)
        }

    changed(copy / "bank" / "leaderboard.csv", without)
    page = findings_page(copy)
    assert "In the room the mean regret is 1.3 % calibrated, 4.5 % physical" in page
    assert "nan" not in re.sub(r"\w*nan\w+|\w+nan\w*", "", page)


def test_no_tables_at_all(tmp_path):
    page = findings_page(tmp_path)
    assert page.startswith("# Findings")
    assert not drawings_of(places_of_reference(tmp_path))


# ---- what sentences claim --------------------------------------------------------------------------------------------


def claims(reference: Path) -> list[str]:
    top = read_tables(reference)
    return [each.claim for each in five_sentences(places_of_reference(reference), top.get("calibration_error", []))]


def test_the_claims_follow_the_numbers(copy):
    """Better than R = I only where the interval of the difference says so; sizes only within a tenth."""
    first, second, third, fourth, fifth = claims(copy)
    assert first == "The paper's R, as printed, is not shown to rank better than R = I in any of 6 cases."
    assert "ρ of 0.93 or more by measured PSS" in second
    assert second.endswith("within 0.1 mm neither it nor counting is shown to rank better.")
    assert "(q ≈ c), calibrated σ∞ ranks better than both counts of what is visible;" in third
    assert third.endswith("at the scenes' own 1 mm a frame it ranks as one of them does.")
    assert "within 0.9 to 1.1 in 3 of 6 cases; its whole interval does in none." in fourth
    assert "costs at most 4.2 % [3.0, 5.5]" in fifth
    assert "break the ranking" in fifth

    def better(row):
        ends = {"spearman_difference_ci_low": "0.01"} if row["noise_model"] == "as-printed" else {}
        return row | ends

    changed(copy / "bank-dim" / "differences.csv", better)
    assert claims(copy)[0] == "The paper's R, as printed, ranks better than R = I in 1 of 6 cases."
    changed(copy / "bank" / "consistency.csv", lambda row: row | {"nees_per_dof": "1.3"})
    assert "in 2 of 6 cases" in claims(copy)[3]


@pytest.mark.parametrize("column", ["minus_visibility_count_ci_low", "minus_visible_share_ci_low"])
def test_both_counts_must_be_beaten(copy, column):
    """σ∞ is better only where neither interval reaches down to 0."""
    changed(copy / "bank" / "process.csv", lambda row: row | {column: "-0.01"})
    assert "in 10 of 12 comparisons" in claims(copy)[2]


def test_a_level_at_which_no_count_ranks_alike(copy):
    """σ∞ at the scenes' noise is called a count only where it is as good as one in every place."""

    def worse(row):
        there = row["metric"] == "visible-share" and row["step_mm"] == "1.0"
        return row | ({"spearman": "0.90"} if there else {})

    changed(copy / "bank-third" / "process.csv", worse)
    assert "1 mm a frame" not in claims(copy)[2]


def test_neutral_measures_decide_by_the_interval(copy):
    """Which of PSS and the count ranks better within 0.1 mm, and in how many cases."""

    def decided(low, high):
        return lambda row: (
            row
            | (
                {"minus_visibility_count_ci_low": low, "minus_visibility_count_ci_high": high}
                if row["measure"] == "share_under_0.1mm"
                else {}
            )
        )

    changed(copy / "bank" / "leaderboard.csv", decided("-0.3", "-0.1"))
    assert claims(copy)[1].endswith("within 0.1 mm counting ranks better in 1 of 6 cases.")
    changed(copy / "bank-third" / "leaderboard.csv", decided("0.1", "0.3"))
    assert claims(copy)[1].endswith("within 0.1 mm counting ranks better in 1 and PSS in 1 of 6 cases.")


def test_the_papers_own_metric_is_in_the_first_sentence(copy):
    """σ∞ as printed against R = I, where it is worse; and what the test shows of other contenders."""
    first = five_sentences(places_of_reference(copy))[0].numbers
    assert "For σ∞ at 1 mm a frame the difference is −0.04 [−0.08, 0.00] in the room" in first
    assert (
        "The same test shows as better than R = I `corrected` in 6, `physical` in 6, `calibrated` in 6 of 6." in first
    )

    def unsure(row):
        wide = row["noise_model"] == "corrected" and row["baseline"] == "identity"
        return row | ({"spearman_difference_ci_low": "-0.1"} if wide else {})

    changed(copy / "bank" / "differences.csv", unsure)
    first = five_sentences(places_of_reference(copy))[0].numbers
    assert "The test has little power: it shows as better than R = I `corrected` in 5, `physical` in 6" in first


def test_frozen_errors_are_named_beside_those_of_each_frame(made_up):
    page = findings_page(made_up)
    assert "drawn anew each frame, by 0.001°, to 0.82 [0.77, 0.84]" in page
    assert "frozen as after a move to a preset, by 0.001°, to 0.57 [0.52, 0.59], in one of 16 draws to 0.30" in page


def test_weights_of_the_papers_factors_are_named(copy):
    assert "Every calibration gives the paper's factors no weight: the fitted R is the physical one times 1.07" in (
        findings_page(copy)
    )
    path = copy / "bank" / "calibrated.toml"
    path.write_text(path.read_text(encoding="utf-8") + "defocus = 0.2\n", encoding="utf-8")
    # The atrium is judged with the room's calibration.
    words = "Of the paper's factors some have a weight: defocus 0.20 in the room, defocus 0.20 in the atrium."
    assert words in findings_page(copy)


# ---- one bank alone --------------------------------------------------------------------------------------------------


def test_a_bank_alone_has_its_sentences_and_tables(made_up):
    text = bank_findings(read_tables(made_up / "bank"))
    assert len(re.findall(r"^\d\. \*\*", text, re.MULTILINE)) == 5
    assert "| atrium |" in text
    assert "studio" not in text


def test_another_number_is_another_page(copy):
    """The text follows the tables: a changed figure shows."""
    before = bank_findings(read_tables(copy / "bank"))
    changed(copy / "bank" / "leaderboard.csv", lambda row: row | {"spearman": "0.123"})
    after = bank_findings(read_tables(copy / "bank"))
    assert after.count("0.12 [") > 30 > before.count("0.12 [")


# ---- figures ---------------------------------------------------------------------------------------------------------


def test_all_figures_are_drawn_from_whole_tables(made_up):
    names = [drawing.name for drawing in drawings_of(places_of_reference(made_up))]
    assert names == [
        f"findings-{name}" for name in ("ranking", "process", "sigma", "regret", "size", "nees", "detection")
    ]


def test_a_changed_number_changes_the_digest_of_its_figure_alone(copy):
    before = {drawing.name: drawing.digest for drawing in drawings_of(places_of_reference(copy))}
    changed(copy / "bank" / "consistency.csv", lambda row: row | {"nees_per_dof": "1.3"})
    after = {drawing.name: drawing.digest for drawing in drawings_of(places_of_reference(copy))}
    assert {name for name in before if before[name] != after[name]} == {"findings-nees"}


def test_files_of_figures(copy, tmp_path):
    """SVG with its digest, the same bytes twice; PDF with TrueType fonts."""
    drawing = next(each for each in drawings_of(places_of_reference(copy)) if each.name == "findings-process")
    once, again = (write_svg(drawing, folder) for folder in (tmp_path, copy))
    assert once.read_bytes() == again.read_bytes()
    assert digest_in(once) == drawing.digest
    pdf = write_pdf(drawing, tmp_path).read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/FontFile2" in pdf or b"/CIDFontType2" in pdf or b"/TrueType" in pdf


def test_contenders_have_one_order_and_signs_that_tell_them_apart():
    looks = [(contender.colour, contender.sign, contender.filled) for contender in CONTENDERS]
    assert len(set(looks)) == len(looks)
    assert [each.name for each in contenders_in(["mine", "calibrated", "as-printed"])] == [
        "as-printed",
        "calibrated",
        "mine",
    ]


# ---- the command -----------------------------------------------------------------------------------------------------


def test_the_command_prints_or_writes(made_up, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("validate.findings.__main__.write_svg", lambda drawing, folder: (folder / drawing.file).touch())
    monkeypatch.setattr("validate.findings.__main__.write_pdf", lambda drawing, folder: (folder / drawing.name).touch())
    page = findings_page(made_up)
    assert run(reference=made_up) == 0
    assert capsys.readouterr().out == page
    (tmp_path / "figures").mkdir()
    assert run(write=True, pdf=tmp_path / "pdf", reference=made_up, docs=tmp_path) == 0
    assert (tmp_path / "findings.md").read_text(encoding="utf-8") == page
    shown = re.findall(r"\(figures/(findings-[\w-]+\.svg)\)", page)
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == sorted(shown)
    assert len(list((tmp_path / "pdf").iterdir())) == len(shown) == 7


def test_the_command_refuses_a_folder_that_is_not_there(tmp_path):
    """A mistyped folder is no page without tables."""
    command = [sys.executable, "-m", "validate.findings", "--reference", str(tmp_path / "none")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 2
    assert "none: no such folder" in done.stderr


# ---- small tables by hand --------------------------------------------------------------------------------------------


def test_numbers_with_and_without_intervals():
    assert with_range("0.934", "-0.1", "0.98") == "0.93 [−0.10, 0.98]"
    assert with_range("0.934", "", "") == "0.93"
    assert with_range("0.9964", "0.98", "0.9991") == "0.996 [0.980, 0.999]"
    assert with_range("0.9964", "0.98", "1.02") == "1.00 [0.98, 1.02]"
    assert with_range("1", "0.98", "1") == "1.00 [0.98, 1.00]"
    assert with_range("", "", "") == with_range("nan", "", "") == "–"
    # No sign before 0; three decimals where two would hide on which side of it an end is.
    assert with_range("-0.002", "-0.14", "0.14") == "0.00 [−0.14, 0.14]"
    assert with_range("0.067", "-0.004", "0.137") == "0.067 [−0.004, 0.137]"


@pytest.mark.parametrize(
    ("value", "text"),
    [(6.39e-5, "6.4·10⁻⁵"), (1e4, "10⁴"), (420.0, "420"), (0.38, "0.38"), (1.8, "1.8"), (-3e-5, "−3·10⁻⁵"), (0.0, "0")],
)
def test_powers_of_ten(value, text):
    assert in_powers(value) == text


def test_pairs_of_one_order_are_one_row(copy):
    """The others are named beside it; a metric that orders nothing is named below."""

    def twins(row):
        same = {"equivalent_to": "pss-single-frame (as-printed)"} if row["noise_model"] == "as-printed, scaled" else {}
        none = {"spearman": ""} if row["noise_model"] == "corrected" else {}
        return row | {"equivalent_to": ""} | same | none

    changed(copy / "bank" / "leaderboard.csv", twins)
    table = neutral_table(places_of_reference(copy)[0])
    assert "| pss-single-frame | as-printed, scaled |" not in table
    (row,) = [line for line in table.splitlines() if line.startswith("| pss-single-frame | as-printed |")]
    assert row.endswith("| pss (as-printed, scaled), pss-single-frame (as-printed, scaled) |")
    assert table.endswith("they order none: pss (corrected), pss-single-frame (corrected).")


def test_columns_that_are_empty_in_every_row_go():
    table = markdown_table(["a", "b", "c"], [["1", "–", "2"], ["3", "", "–"]])
    assert table.splitlines() == ["| a | c |", "|---|---|", "| 1 | 2 |", "| 3 | – |"]
    assert markdown_table(["a"], []) == ""


def test_the_budget_by_hand():
    """Of two steps the lower and the higher factor; one number where they are the same; other models are left out."""
    factors = {"budget_noise_model": "0.9", "budget_detector": "1.1", "budget_geometry": "1"}
    step = {"sweep": "s", "noise_model": "physical", "pss_single_frame": "4", **factors}
    rows = [
        {**step, "measured_pss_single_frame": "3", "budget_visibility": "0.7576"},
        {**step, "measured_pss_single_frame": "2", "budget_visibility": "0.5051"},
        {**step, "noise_model": "corrected", "measured_pss_single_frame": "9", "budget_visibility": "9"},
    ]
    last = budget_findings(rows).splitlines()[-1]
    assert last == "| s | 2 | 0.50 to 0.75 | 0.51 to 0.76 | 0.90 | 1.10 | 1.00 |"


def test_factors_by_hand():
    """Two sweeps, two models: who is inside the interval, who has the wrong sign."""
    measured = {"measured_slope": "-0.5", "measured_slope_ci_low": "-0.6", "measured_slope_ci_high": "-0.4"}
    rows = [
        {"sweep": sweep, "noise_model": model, "predicted_slope": slope, **measured}
        for sweep, model, slope in (
            ("exposure", "physical", "-0.55"),
            ("exposure", "corrected", "0.1"),
            ("exposure", "as-printed", "-0.3"),
            ("mine", "physical", "-0.2"),
            ("mine", "corrected", "-0.5"),
            ("mine", "as-printed", "-0.5"),
        )
    ]
    text = factor_findings(rows)
    assert "| exposure time | exposure | −0.50 [−0.60, −0.40] | −0.55 | 0.10 | −0.30 |" in text
    assert "| physical | 1 of 2 | 0.18 | 0.30 | none |" in text
    # The median of an even number: the mean of the middle two, here of 0 and 0.6.
    assert "| corrected | 1 of 2 | 0.30 | 0.60 | exposure |" in text
