"""Named sensors: files in `scenes/sensors`, from which a scene's [sensor] starts if it has a `name`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenes.errors import Problems, nearest
from scenes.reading.document import read_toml

__all__ = ["known_sensors", "read_sensor", "start_from_named_sensor"]

SENSORS = Path(__file__).parents[1] / "sensors"


def known_sensors() -> list[str]:
    """Names of the sensors that come with the project."""
    return sorted(file.stem for file in SENSORS.glob("*.toml"))


def read_sensor(name: str) -> dict[str, Any]:
    """The keys of [sensor] of a named sensor, without those of its exposure.

    Raises:
        SceneError: the file is missing, or is not valid TOML.
    """
    return read_toml(SENSORS / f"{name}.toml")


def start_from_named_sensor(problems: Problems) -> None:
    """Complete [sensor] with the values of the sensor of that `name`; those of the file take precedence.

    A wrong name is one problem, not one for each missing key: the nearest sensor completes them.
    """
    table = problems.document.get("sensor")
    if not isinstance(table, dict) or "name" not in table:
        return
    name, known = table["name"], known_sensors()
    guess = known[0]
    if isinstance(name, str) and name not in known:
        hint, near = nearest(name, known)
        problems.add(("sensor", "name"), f"{', '.join(known)}{hint}")
        guess = near or guess
    base = read_sensor(name if name in known else guess)
    problems.document = problems.document | {"sensor": base | table}
