"""Sentences and table on errors of calibration, from rows made by hand."""

from __future__ import annotations

from validate.findings.calibration_error import calibration_error_findings, calibration_error_sentences

EACH_FRAME, FROZEN = ("each frame", "over calibrations"), ("frozen", "within one calibration")
NAMES = ("plain", "with_term", "gain", "propagated", "other_draws")


def row(size, population, weights="own", **rho):
    """A row of the table; ρ of what is not given is that of the plain prediction."""
    content = dict(zip(("pan_tilt_deg", "focal_share", "position_m"), size, strict=True))
    content |= {"kind": population[0], "judged": population[1], "weights": weights}
    content |= {"n": 200, "draws": 12, "median_rms_m": 1e-3, "rms_over_plain": 30, "rms_over_matching": 0.97}
    for name in NAMES:
        value = rho.get(name, rho["plain"])
        content |= {f"spearman_{name}{end}": value for end in ("", "_low", "_high")}
        content |= {f"spearman_{name}_min": value - 0.1, f"spearman_{name}_max": value + 0.1}
    return {key: str(value) for key, value in content.items()}


ALL = (0.1, 0.005, 0.005)
ROWS = [
    row((0, 0, 0), EACH_FRAME, plain=0.97),
    row((0, 0, 0), FROZEN, plain=0.97),
    row((0.01, 0, 0), EACH_FRAME, plain=0.95),
    row((0.01, 0, 0), FROZEN, plain=0.8),
    row((0.02, 0, 0), EACH_FRAME, plain=0.8),
    row((0.02, 0, 0), FROZEN, plain=0.7),
    row((0, 0.001, 0), EACH_FRAME, plain=0.9),
    row((0, 0, 0.002), EACH_FRAME, plain=0.5),
    row(ALL, EACH_FRAME, plain=0.4, with_term=0.8, gain=0.4, propagated=0.85),
    row(ALL, EACH_FRAME, "with term", plain=0.4, with_term=0.9, gain=0.5),
    row(ALL, FROZEN, plain=0.3, with_term=0.45, gain=0.15, other_draws=0.47),
    row(ALL, FROZEN, "with term", plain=0.3, with_term=0.5, gain=0.2, other_draws=0.52),
]


def test_the_smallest_error_that_costs_a_tenth_is_named():
    """Of each kind of error and population; one that costs less at every size is not."""
    text = calibration_error_sentences(ROWS)
    assert "over calibrations, from pan and tilt off by 0.02°, place off by 2 mm on; " in text
    assert "within one frozen calibration from pan and tilt off by 0.01° on." in text
    assert "focal length off by" not in text


def test_what_the_terms_give_back():
    """In the prediction, in the weights too, and beside what other draws say."""
    text = calibration_error_sentences(ROWS)
    both = "With all three of 0.1°, 0.5 %, 5 mm, ρ over calibrations is 0.40 [0.40, 0.40]; "
    assert (
        both + "a term for the errors in the predicted R changes it by 0.40 [0.40, 0.40] to 0.80 [0.80, 0.80]" in text
    )
    assert "in triangulation's weights too 0.90 [0.90, 0.90]." in text
    assert (
        "it is 0.30 [0.30, 0.30] on average (0.20 to 0.40 among 12 draws), and 0.45 [0.45, 0.45] with the term" in text
    )
    assert "under the other calibrations reaches 0.47 [0.47, 0.47]" in text
    assert (
        "measured over predicted RMS is 0.97 in the median, within one calibration 0.97; without the term 30." in text
    )


def test_the_table_has_a_line_for_each_size():
    lines = calibration_error_findings(ROWS).splitlines()[-6:]
    assert lines[0].startswith("|  |  |  | 1.00 | 0.97 [0.97, 0.97] |")
    assert lines[-1] == (
        "| 0.1° | 0.5 % | 5 mm | 1.00 | 0.40 [0.40, 0.40] | 0.80 [0.80, 0.80] | 0.85 [0.85, 0.85] | "
        "0.90 [0.90, 0.90] | "
        "0.30 [0.30, 0.30] | 0.45 [0.45, 0.45] | 0.50 [0.50, 0.50] | 0.47 [0.47, 0.47] |"
    )


def test_a_table_of_an_earlier_version():
    """Errors of each frame alone, without the columns that tell kinds apart."""
    old = []
    for each in ROWS:
        if (each["kind"], each["weights"]) == ("each frame", "own"):
            kept = {
                name for name in each if not name.startswith(("rms_over", "draws", "spearman_other", "spearman_prop"))
            }
            old.append({name: each[name] for name in kept - {"kind", "judged", "weights"}})
    text = calibration_error_findings(old)
    assert "from pan and tilt off by 0.02°, place off by 2 mm on." in text
    assert "frozen calibration, which" not in text
