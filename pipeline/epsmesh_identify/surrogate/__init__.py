"""Forces over ranges of parameters: few solves on chosen points, interpolated with an error."""
