"""What the gate claims: the sizes of its bank, and the bounds."""

from __future__ import annotations

from tests.gate.gate import family_level

COUNTS = (3, 4)
CONFIGURATIONS = 250
# What Spearman's ρ within a camera count has to reach. Over 12 seeds of the captures' noise, 10 or 30 trials a view, it
# is 0.947 to 0.963; 0.82 to 0.89 for a prediction that ignores focus, and 0.57 to 0.72 for one that ignores occlusion.
LEAST_RHO = 0.92
# What its interval's lower end has to reach, at the level of the whole family. A jackknife over seven cameras is rough:
# with the same seeds the lower end is 0.38 to 0.80, and −0.07 to 0.03 for the prediction that ignores occlusion.
BOUND = 0.2
# Both counts, and the turn of a camera.
LEVEL = family_level(len(COUNTS) + 1)
# Half a pixel at the gate's zooms, which nobody tells the measuring side.
TURN_DEG, TURNED_VIEW = 0.02, 14
