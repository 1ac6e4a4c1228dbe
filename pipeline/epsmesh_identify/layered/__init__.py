"""Round frictionless tools on layered half-spaces, by integral equations: a force in a fraction of a second."""
