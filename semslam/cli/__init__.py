"""The semslam command: the only place that prints and exits. Heavy packages are imported inside the commands."""

from semslam.cli.app import main

__all__ = ["main"]
