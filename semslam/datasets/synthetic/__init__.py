"""Rendered scenes with exact poses, depth and labels."""

from semslam.datasets.synthetic.dataset import Request, SyntheticDataset
from semslam.datasets.synthetic.tum_writer import write_tum

__all__ = ["Request", "SyntheticDataset", "write_tum"]
