"""What all pages have in common: one HTML file that refers to no other, with its data, plotly and script inside."""

from __future__ import annotations

from typing import Any

import jinja2
import plotly.offline

from pss.json_text import json_text

__all__ = ["json_in_page", "rendered"]


def json_in_page(value: Any) -> str:
    """JSON that may stand in a script element."""
    text = json_text(value, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def rendered(package: str, name: str, data: Any, **words: Any) -> str:
    """A page of a package's own template NAME.html.j2, which extends "frame.html.j2", with its NAME.js and NAME.css.

    Args:
        data: what the script draws from, as JSON has it.
        words: values for the template.
    """
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader(package), jinja2.PackageLoader("validate.pages")])
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)

    def text(file: str) -> str:
        return loader.get_source(environment, file)[0]

    return environment.get_template(f"{name}.html.j2").render(
        css=text("report.css") + text(f"{name}.css"),
        script=text("figures.js") + text(f"{name}.js"),
        plotly=plotly.offline.get_plotlyjs(),
        data=json_in_page(data),
        **words,
    )
