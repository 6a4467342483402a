"""The semslam command: the only place that prints and exits. Heavy packages are imported inside the commands."""

import os

# Before numpy is imported: small products gain nothing from threads, and OpenBLAS's spin while other stages work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from semslam.cli.app import main

__all__ = ["main"]
