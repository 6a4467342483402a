"""Names for arrays, by the kind of number or by what they hold."""

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Covariance6, Float32Array, FloatArray, Points3, Transform, Transforms

__all__ = [
    "Covariance6",
    "Float32Array",
    "FloatArray",
    "IntArray",
    "Points3",
    "Transform",
    "Transforms",
    "UInt8Array",
]

UInt8Array = npt.NDArray[np.uint8]
IntArray = npt.NDArray[np.int64]
