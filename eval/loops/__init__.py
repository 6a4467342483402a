"""Loop detectors against ground truth."""
