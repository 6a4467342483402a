"""Loop closures: detectors that propose them and the verification that decides."""
