"""The one family of errors that semslam raises for what a user can correct, and its warning."""


def printable(text: str) -> str:
    """Text that is safe on a terminal: control characters, escapes and the like as their codes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shortened(text: str, limit: int = 80) -> str:
    """Text of at most ``limit`` characters, for values from outside in a message."""
    return text if len(text) <= limit else f"{text[: limit - 3]}..."


class SemslamError(Exception):
    """Something is wrong with the input, a setting or the machine; the message is one clear sentence.

    Names and values from files stand in the message, so control characters are taken out of it.
    """

    def __init__(self, sentence: str = "") -> None:
        super().__init__(printable(sentence))


class SemslamWarning(UserWarning):
    """Something was left out or passed over; the message is one clear sentence."""

    def __init__(self, sentence: str = "") -> None:
        super().__init__(printable(sentence))


class DatasetError(SemslamError):
    """A sequence cannot be found, recognised or read."""


class TrajectoryError(SemslamError):
    """A trajectory is not finite, not in order, not rigid, or does not meet its ground truth."""


class ConfigError(SemslamError):
    """A setting or a name is unknown or out of its range."""


class GraphError(SemslamError):
    """A pose graph is malformed or could not be optimised."""


class ResultsError(SemslamError):
    """A run folder cannot be written or read."""


class ModelError(SemslamError):
    """Network weights are missing, of another network, or damaged."""


FOREIGN = (Exception, SystemExit)
"""What a part from outside may raise: one that calls ``sys.exit`` must not end a run in silence."""


def as_our_own(error: BaseException) -> SemslamError:
    """An error of any kind as one clear sentence."""
    if isinstance(error, SemslamError):
        return error
    if isinstance(error, MemoryError):
        return SemslamError("There is not enough memory.")
    return SemslamError(f"{type(error).__name__}: {' '.join(str(error).split())}.")
