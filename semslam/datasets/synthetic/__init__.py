"""Rendered scenes with exact poses, depth and labels."""

from semslam.datasets.synthetic.dataset import Request, SyntheticDataset

__all__ = ["Request", "SyntheticDataset"]
