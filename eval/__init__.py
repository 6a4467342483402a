"""Evaluation: trajectories, loop truth, plots and reports."""
