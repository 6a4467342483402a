"""Loop detectors, one folder for each method."""
