"""``pip install -e .[test] && pytest``: the detector keeps what semslam asks of every detector."""

from semslam_colours import ColourDetector

from semslam.testing import DetectorContract


class TestColourDetector(DetectorContract):
    """All of them; further tests go below."""

    implementation = ColourDetector
