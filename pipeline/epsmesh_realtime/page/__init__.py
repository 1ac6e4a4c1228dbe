"""A page on which a tool is dragged over a real-time model: what is seen of it, and what the hand would feel."""
