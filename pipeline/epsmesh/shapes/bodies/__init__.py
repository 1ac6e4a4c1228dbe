"""Bodies, one per file."""
