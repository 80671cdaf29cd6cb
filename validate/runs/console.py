"""The console of all commands: words of users and of files are printed as they are, and never as markup."""

from __future__ import annotations

from typing import Any

import rich.console
from rich.text import Text

__all__ = ["Console", "printable"]


class Console(rich.console.Console):
    """A `rich.console.Console` to which no text is markup: not "[/b]", not ":warning:", no sequence for the terminal.

    A pipe that its reader has closed raises `BrokenPipeError`, as `print` does; `run_sweep.main` ends the program.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """As the base class, which tables call for their titles and cells as well; unprintable signs as escapes."""
        return super().render_str(printable(text), **options)

    def on_broken_pipe(self) -> None:
        """Let the error through: the base class would end the program with exit code 1."""
        raise


def printable(text: str) -> str:
    """A text without what would speak to the terminal, which becomes an escape; lines stay lines."""
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign == "\n" else sign.encode("unicode_escape").decode() for sign in text
    )
