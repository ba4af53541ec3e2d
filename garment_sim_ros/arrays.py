"""Types of arrays by what they hold; docstrings give shapes and units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Double precision: everything outside of the solvers."""
SingleArray = NDArray[np.float32]
"""Single precision: the state of cloth."""
IntArray = NDArray[np.int32]
"""Indices and counts."""
IndexArray = NDArray[np.uint32]
"""Indices that compiled code need not check for negative ones."""
LongArray = NDArray[np.int64]
"""Stamps [ns], numbers that do not fit into 32 bits, and what numpy returns for indices."""
ShortArray = NDArray[np.int16]
"""Distances in whole steps."""
AnyArray = NDArray[Any]
"""Numbers of any type."""
