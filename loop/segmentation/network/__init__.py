"""The segmentation network and its weights."""
