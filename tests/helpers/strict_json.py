"""JSON as the standard has it."""

from __future__ import annotations

import json
from typing import Any


def strict(text: str) -> Any:
    """JSON as its standard has it."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)
