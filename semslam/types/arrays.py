"""Names for arrays of one kind of number."""

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, FloatArray

__all__ = ["Float32Array", "FloatArray", "IntArray", "UInt8Array"]

UInt8Array = npt.NDArray[np.uint8]
IntArray = npt.NDArray[np.int64]
