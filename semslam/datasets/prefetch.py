"""Reading ahead in the background."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.runtime.stopwatch import Stopwatch
from semslam.types import Frame


def prefetch(
    dataset: Dataset,
    ahead: int = 4,
    stopwatch: Stopwatch | None = None,
    prepare: Callable[[Frame], None] = lambda frame: None,
) -> Iterator[Frame | DatasetError]:
    """Read frames in order while the caller works on the one before.

    One thread reads, so the dataset need not be safe for several; decoding leaves the interpreter free. The
    thread ends when the iterator is used up, closed or garbage.

    Args:
        dataset: the sequence.
        ahead: maximum number of frames kept ready.
        stopwatch: is shown how long reading takes.
        prepare: called with each frame once it is read, in the thread that reads.

    Yields:
        One item per frame, in order: the frame, or the error that stands in its place.

    Raises:
        Exception: whatever else the dataset or ``prepare`` raises, at the frame's place.
    """
    reader = ThreadPoolExecutor(max_workers=1, thread_name_prefix="semslam-reader")
    watch = stopwatch or Stopwatch()
    pending: deque[Future[Frame | DatasetError]] = deque()
    try:
        for index in range(len(dataset)):
            pending.append(reader.submit(_read_and_prepare, dataset, index, watch, prepare))
            if len(pending) > ahead:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        reader.shutdown(wait=True, cancel_futures=True)


def read(dataset: Dataset, index: int, stopwatch: Stopwatch) -> Frame | DatasetError:
    """A frame, or the error that stands in its place."""
    try:
        with stopwatch.stage("read"):
            return dataset.frame(index)
    except DatasetError as error:
        return error


def _read_and_prepare(
    dataset: Dataset, index: int, stopwatch: Stopwatch, prepare: Callable[[Frame], None]
) -> Frame | DatasetError:
    item = read(dataset, index, stopwatch)
    if not isinstance(item, DatasetError):
        prepare(item)
    return item
