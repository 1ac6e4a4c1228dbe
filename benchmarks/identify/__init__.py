"""How right identifications are: synthetic and measured force curves."""
