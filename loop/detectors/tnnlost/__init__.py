"""Convolutional features calibrated by semantics, aggregated over their nearest centres."""
