"""Contact that finds its own area: frictionless, without tension and without penetration."""
