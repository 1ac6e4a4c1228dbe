"""Unilateral contact with unknown area: frictionless, without tension and without penetration."""
