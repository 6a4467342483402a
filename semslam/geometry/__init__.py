"""Rigid transforms, cameras and reprojection errors."""
