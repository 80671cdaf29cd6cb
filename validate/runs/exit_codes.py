"""Exit codes of the command; docs/runs.md describes them for users."""

from __future__ import annotations

__all__ = [
    "EXIT_BROKEN",
    "EXIT_CLOSED_PIPE",
    "EXIT_CODES",
    "EXIT_DONE",
    "EXIT_FAILED",
    "EXIT_INTERRUPTED",
    "EXIT_MISTAKE",
]

EXIT_DONE, EXIT_FAILED, EXIT_MISTAKE, EXIT_INTERRUPTED = 0, 1, 2, 130
# Python's own 1 for an uncaught exception would mean "done, with failed views"; 70 is EX_SOFTWARE of sysexits.h.
EXIT_BROKEN = 70

# What shells report of a program that ends by SIGPIPE, as most do.
EXIT_CLOSED_PIPE = 141

# For --help.
EXIT_CODES = (
    "Exit codes: 0 done; 1 done, with failed views, which are named, and the rest complete; "
    "2 your mistake, or what only you can put right (a full disk, a folder that cannot be written); "
    "70 an error of the program; 130 interrupted; 141 the reader of the output ended first. See docs/runs.md."
)
