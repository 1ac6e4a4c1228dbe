"""Material parameters from measured force curves, with error bars."""
