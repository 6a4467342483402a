"""What watches a run; the algorithm knows nothing of it."""
