"""What all figures share: the commands draw them without a screen, and no text in them is markup.

Every module that draws with `plt` imports it from here. Titles are users' words: "$x_{1$" is drawn as it stands, where
Matplotlib would read a formula. Logarithmic axes therefore need a formatter of plain numbers, such as "{x:g}": the
default one writes formulas.
"""

from __future__ import annotations

import os
import sys

import matplotlib

# A notebook, or a script that draws, has decided where its figures are shown, and is left as it is.
if "MPLBACKEND" not in os.environ and "matplotlib.pyplot" not in sys.modules:
    matplotlib.use("Agg")

import matplotlib.pyplot as plt

__all__ = ["plt"]

matplotlib.rcParams["text.parse_math"] = False
