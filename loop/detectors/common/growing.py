"""Arrays that grow by rows without copying everything each time."""

from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

ScalarT = TypeVar("ScalarT", bound=np.generic)


class GrowingArray(Generic[ScalarT]):
    """Rows of one shape and type, appended at amortised constant cost.

    Args:
        dtype: type of the elements.
        row_shape: shape of a row; () for a vector of scalars.
    """

    def __init__(self, dtype: type[ScalarT], row_shape: tuple[int, ...] = ()) -> None:
        self._rows: npt.NDArray[ScalarT] = np.empty((16, *row_shape), dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def rows(self) -> npt.NDArray[ScalarT]:
        """A view (N, ...) of what was appended; valid until the next append."""
        return self._rows[: self._count]

    def append(self, rows: npt.ArrayLike) -> None:
        """Add rows (K, ...) at the end."""
        new = np.asarray(rows, dtype=self._rows.dtype)
        needed = self._count + len(new)
        if needed > len(self._rows):
            grown = np.empty((max(needed, 2 * len(self._rows)), *self._rows.shape[1:]), self._rows.dtype)
            grown[: self._count] = self._rows[: self._count]
            self._rows = grown
        self._rows[self._count : needed] = new
        self._count = needed
