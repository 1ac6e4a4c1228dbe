"""What ``[solve] influence`` asks for: shares of the force, within a distance of the touch."""

# Shares of F whose distances are given: 50, 90 and 99 % are read, the others draw the curve.
DECIDED = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
