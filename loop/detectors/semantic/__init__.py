"""Loop detection from semantic nodes (Li et al. 2022)."""
