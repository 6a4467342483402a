"""Convolutional features of what does not move."""
