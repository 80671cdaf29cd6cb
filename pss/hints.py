"""Type aliases that all packages share: arrays by kind of number, and table rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

__all__ = ["AnyFloats", "Bools", "CsvRow", "Floats", "Images", "Indices", "Integers", "Pixels", "ReadOnlyRow", "Row"]

Floats = NDArray[np.float64]
AnyFloats = NDArray[np.floating]
"""Single or double precision."""
Images = NDArray[np.float32]
"""Images and maps of the renderer."""
Pixels = NDArray[np.uint8]
"""Images for display."""
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]

Row = dict[str, object]
"""A table row under construction, by column name."""
ReadOnlyRow = Mapping[str, object]
CsvRow = Mapping[str, str]
"""A row read from a CSV file: text, by column name."""
