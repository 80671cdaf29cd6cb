"""Strategies (section 4.2): each is a function from a state to the avatar that each camera follows.

The paper's are (1) `follow_throughout`, (2a) `swap_to_farther` and (2b) `swap_to_closer`. One's own is any function of
a `StrategyState` that returns one avatar's name for each camera; see docs/hallway.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pss import RangeError
from render.random_streams import random_stream
from scenes.errors import nearest
from validate.schedule.state import Assignment, StrategyState

__all__ = [
    "STRATEGIES",
    "Strategy",
    "best_predicted",
    "follow_throughout",
    "random_assignment",
    "strategy_named",
    "swap_to_closer",
    "swap_to_farther",
]

Strategy = Callable[[StrategyState], tuple[str, ...]]

Y = 1  # the hallway's long side
# Relative: assignments whose predicted PSS differ by rounding alone are equally good.
SAME_PSS = 1e-9


def follow_throughout(state: StrategyState) -> Assignment:
    """(1): each avatar keeps its share of the cameras, in their order; with four, 1 and 2 follow H1, 3 and 4 follow H2.

    What is left over when the cameras can't be shared evenly goes to the first avatars.
    """
    cameras, avatars = len(state.cameras), len(state.names)
    shares = [cameras // avatars + (index < cameras % avatars) for index in range(avatars)]
    return tuple(name for name, share in zip(state.names, shares, strict=True) for _ in range(share))


def swap_to_farther(state: StrategyState) -> Assignment:
    """(2a): each camera follows the avatar that is farther from it along y, so that all swap when the avatars cross."""
    return _by_distance(state, sign=-1.0)


def swap_to_closer(state: StrategyState) -> Assignment:
    """(2b): each camera follows the avatar that is closer to it along y.

    With H1 starting at the end of cameras 1 and 2 it is the paper's: 1 and 2 first follow H1, then swap to H2, and
    3 and 4 first follow H2, then swap to H1. Distance counts along the hallway alone, since the pairs swap "when the
    avatars cross paths", both cameras at once: by the straight distance the one beside an avatar's lane would swap
    later than the other.
    """
    return _by_distance(state, sign=1.0)


def random_assignment(state: StrategyState) -> Assignment:
    """Any avatar for each camera, drawn anew at each decision from the plan's seed and the number of the step alone."""
    rng = random_stream(state.plan.seed, "hallway", "random assignment", state.step)
    return tuple(state.names[index] for index in rng.integers(len(state.names), size=len(state.cameras)))


def best_predicted(state: StrategyState) -> Assignment:
    """The assignment with the highest predicted PSS at the settings that the motors reach by the next decision.

    All are evaluated in one call, those with all cameras on one avatar among them. Of equally good ones: one that
    leaves no avatar out, then the one with the fewest changes, then the first. It plans one step ahead:
    where motors are slow it shuns a swing that would pay only later, and where PSS hardly differs it swaps a lot.
    """
    choices = state.assignments
    pss = state.predicted_pss(choices)
    best = [choices[k] for k in np.flatnonzero(pss >= (1 - SAME_PSS) * pss.max())]
    return min(best, key=lambda choice: (len(state.names) - len(set(choice)), _changes(state, choice)))


STRATEGIES: dict[str, Strategy] = {
    "follow": follow_throughout,
    "swap-to-farther": swap_to_farther,
    "swap-to-closer": swap_to_closer,
    "random": random_assignment,
    "best-predicted": best_predicted,
}


def strategy_named(name: str) -> Strategy:
    """The strategy that `STRATEGIES` has under `name`.

    Raises:
        RangeError: none; the message has the nearest name and all names.
    """
    if name not in STRATEGIES:
        hint = nearest(str(name), STRATEGIES)[0]
        raise RangeError(f"strategy = {name!r}{hint}; allowed: {', '.join(STRATEGIES)}")
    return STRATEGIES[name]


def _by_distance(state: StrategyState, sign: float) -> Assignment:
    """For each camera the avatar with the least `sign` · distance along y; the one it has, if within the margin."""
    chosen = []
    for index, camera in enumerate(state.cameras):
        worth = {name: sign * abs(float(state.predicted_m[name][Y]) - camera.position_m[Y]) for name in state.names}
        best = min(state.names, key=worth.__getitem__)
        if state.previous is not None and worth[state.previous[index]] <= worth[best] + state.plan.swap_margin_m:
            best = state.previous[index]
        chosen.append(best)
    return tuple(chosen)


def _changes(state: StrategyState, choice: Assignment) -> int:
    """Cameras that would be assigned to another avatar than before."""
    return 0 if state.previous is None else sum(a != b for a, b in zip(choice, state.previous, strict=True))
