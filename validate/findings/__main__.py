"""Print docs/findings.md."""

from pathlib import Path

from validate.findings.page import findings_page

if __name__ == "__main__":
    print(findings_page(Path(__file__).resolve().parents[2] / "results" / "reference"), end="")
