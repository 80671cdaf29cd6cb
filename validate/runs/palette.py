"""Colours of all figures and pages, legible in print and without colour vision; needs no plotting library."""

from __future__ import annotations

# ---- categories (Okabe and Ito) --------------------------------------------------------------------------------------

BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
PURPLE, SKY_BLUE, ORANGE = "#CC79A7", "#56B4E9", "#E69F00"
CATEGORIES = (BLUE, VERMILION, GREEN, PURPLE, SKY_BLUE, ORANGE)
"""Noise models, objects, strategies and compared runs, in this order."""

# Beside them, where families of noise models are told apart: darker, so that hollow signs are legible.
OCHRE, DARK_GREEN = "#B07A00", "#00795A"
# Behind the lines of two people.
TINT_BLUE, TINT_VERMILION = "#bcd7ec", "#f3d3bd"

# ---- black to white --------------------------------------------------------------------------------------------------

MEASURED = "#111111"
"""What is measured, and bounds on it, in figures of Matplotlib."""
INK = "#1a1a1a"
"""Words and what is measured on pages."""
DARK_INK = "#222222"
OUTLINE = "#444"
REFERENCE = "#555555"
"""Lines of what would be ideal, and what has no term for an error."""
MIDDLE_GREY = "#777777"
FRAME = "#888888"
GREY = "#8a8a8a"
ROOM_EDGES = "#9a9a9a"
UNKNOWN_GREY = "#b3b3b3"
ZERO_LINE = "#bbbbbb"
OTHER_POINTS = "#c9c9c9"
FINDINGS_GRID = "#DDDDDD"
GRID = "#e4e4e4"
OBJECTS = "#e9e9e9"
FLOOR = "#f1efe9"
FINDINGS_BAND = "#F3F3F3"

# ---- signals ---------------------------------------------------------------------------------------------------------

UNSEEN, LAMP, FOUND = "#D00000", "#c9a400", "#3CDC50"
WELCOME_BAND = "#BFE3D0"
"""Where values are as they should be."""

# ---- scales ----------------------------------------------------------------------------------------------------------

# From low to high error: light to dark.
VIRIDIS = ((0.0, "#fde725"), (0.25, "#5ec962"), (0.5, "#21918c"), (0.75, "#3b528b"), (1.0, "#440154"))
# Light in the middle, dark at both ends, and told apart by all kinds of colour vision (ColorBrewer's PuOr).
PURPLE_ORANGE = [[0, "#2d004b"], [0.25, "#8073ac"], [0.5, "#f0f0f0"], [0.75, "#e08214"], [1, "#7f3b08"]]
