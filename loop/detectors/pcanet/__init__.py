"""A principal component analysis network."""
