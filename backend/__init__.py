"""The pose graph: the only package that knows gtsam."""
