"""The one family of errors that semslam raises for what a user can mend, and its warning."""


class SemslamError(Exception):
    """Something is wrong with the input, a setting or the machine; the message is one clear sentence."""


class SemslamWarning(UserWarning):
    """Something was left out or passed over; the message is one clear sentence."""


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
