"""Many runs by one engine: sequences, odometries, settings, seeds, starts and detectors; tracked once where shared."""
