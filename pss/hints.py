"""Type aliases that all packages share: arrays by their kind of number, and rows of tables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

__all__ = ["AnyFloats", "Bools", "CsvRow", "Floats", "Images", "Indices", "Integers", "Pixels", "ReadOnlyRow", "Row"]

Floats = NDArray[np.float64]
AnyFloats = NDArray[np.floating]
"""Single or double precision."""
Images = NDArray[np.float32]
"""Images and maps as the renderer gives them."""
Pixels = NDArray[np.uint8]
"""Pictures for the eye."""
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]

Row = dict[str, object]
"""A row of a table that is being made, by column name."""
ReadOnlyRow = Mapping[str, object]
CsvRow = Mapping[str, str]
"""A row as it was read from a CSV file: text, by column name."""
