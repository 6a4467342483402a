"""Semantic segmentation: the network, its training and its use."""
