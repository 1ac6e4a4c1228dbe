"""Models for real time: what a body makes of a point force, at all places of a region, as a small file."""
