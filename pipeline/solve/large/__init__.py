"""Large displacements: neo-Hookean bodies, by Newton's method over load steps."""
