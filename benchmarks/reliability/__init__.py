"""Faults put into real runs of the command line, and what comes of each: ``python -m benchmarks.reliability``."""
