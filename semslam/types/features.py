"""What is found in one frame: keypoints, and the surface as points."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.types.arrays import Float32Array, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Keypoints of one frame.

    Attributes:
        pixels: (N, 2) float32, undistorted.
        depths: (N,) float32 metres; 0 = none.
        octaves: (N,) uint8 pyramid levels.
        angles: (N,) float32 orientations in degrees.
        descriptors: (N, 32) uint8 binary descriptors (ORB).
        points: (N, 3) float32 camera-frame metres; rows without depth are zero.
    """

    pixels: Float32Array
    depths: Float32Array
    octaves: UInt8Array
    angles: Float32Array
    descriptors: UInt8Array
    points: Float32Array

    def __len__(self) -> int:
        return len(self.pixels)

    def take(self, chosen: npt.NDArray[np.generic]) -> "Features":
        """Some of the keypoints, given by indices or by a mask."""
        return Features(
            self.pixels[chosen],
            self.depths[chosen],
            self.octaves[chosen],
            self.angles[chosen],
            self.descriptors[chosen],
            self.points[chosen],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """A thinned point cloud in the camera frame.

    Attributes:
        points: (N, 3) float32 metres.
        normals: (N, 3) float32, of length 1.
        colors: (N, 3) uint8 RGB, where they are known.
    """

    points: Float32Array
    normals: Float32Array
    colors: UInt8Array | None = None

    def __len__(self) -> int:
        return len(self.points)
