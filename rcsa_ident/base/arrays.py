"""Read-only arrays: a noun's numbers do not change behind its back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# names for the reader; numpy's stubs lose the dtype in too many functions for a checker to hold them
FloatArray = NDArray[Any]
ComplexArray = NDArray[Any]


def frozen(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Return a read-only, contiguous array of `values`; an array that is already so is returned as it is."""
    array = np.ascontiguousarray(values, dtype=dtype)
    if array is values and array.flags.writeable:
        array = array.copy()
    array.setflags(write=False)
    return array
