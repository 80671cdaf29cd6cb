"""What all figures share: they are drawn without a screen, and no text in them is markup.

Every module that draws with `plt` imports it from here. Titles are users' words: "$x_{1$" is drawn as it stands, where
Matplotlib would read a formula. Logarithmic axes therefore need a formatter of plain numbers, such as "{x:g}": the
default one writes formulas.
"""

from __future__ import annotations

import matplotlib
import matplotlib.pyplot as plt

__all__ = ["plt"]

matplotlib.use("Agg")
matplotlib.rcParams["text.parse_math"] = False
