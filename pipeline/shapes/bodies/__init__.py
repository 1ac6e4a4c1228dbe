"""One file a body."""
