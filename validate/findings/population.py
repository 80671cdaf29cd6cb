"""The configurations, views and conditions of the findings, in words."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.places import Place

__all__ = ["cases", "common_population", "titles"]

CONDITIONS = "registered markers; dim light unless named; perfect calibration unless named; a closed world"
IN_WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def cases(places: Sequence[Place]) -> str:
    """How many cases of a room in a light: "5 cases"; the title of one."""
    return f"the {places[0].title}" if len(places) == 1 else f"{len(places)} cases"


def titles(places: Sequence[Place]) -> str:
    """The room, the atrium and the studio."""
    names = [f"the {place.title}" for place in places]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def common_population(places: Sequence[Place]) -> str:
    """What all sentences share; "" without places."""
    if not places:
        return ""
    counts = dict.fromkeys(row["n"] for place in places if (row := _any_row(place)) and row.get("n"))
    parts = [f"{' or '.join(counts)} configurations of four cameras"]
    if len(places) > 1:
        parts[0] += f" in each of {cases(places)}: {_rooms_and_lights(places)}"
    parts.append(f"settings of {', '.join(dict.fromkeys(place.population for place in places))} camera places")
    if views := _views(places):
        parts.append(views)
    return f"*Population of all, unless named:* {'; '.join([*parts, CONDITIONS])}."


def _rooms_and_lights(places: Sequence[Place]) -> str:
    """Three rooms, one of them in three lights."""
    rooms = sum(place.own_light for place in places)
    lights = 1 + len(places) - rooms
    words = "one room" if rooms == 1 else f"{_word(rooms)} rooms"
    if lights == 1:
        return words
    return f"{words} in {_word(lights)} lights" if rooms == 1 else f"{words}, one of them in {_word(lights)} lights"


def _views(places: Sequence[Place]) -> str:
    """How many held-out views there are, and how often each was rendered."""
    kinds: dict[tuple[str, int], list[str]] = {}
    for place in places:
        if place.views:
            kinds.setdefault((place.views, place.renders), []).append(place.title)
    parts = []
    for (views, renders), names in kinds.items():
        times = f" rendered {'once' if renders == 1 else 'twice' if renders == 2 else f'{renders} times'}" * bool(
            renders
        )
        parts.append(f"{views} held-out views{times} ({', '.join(names)})")
    return ", ".join(parts)


def _word(number: int) -> str:
    return IN_WORDS[number] if number < len(IN_WORDS) else f"{number}"


def _any_row(place: Place) -> CsvRow | None:
    return next((row for model in place.models if (row := place.ranked(model))), None)
