"""Round scenes in the half plane (r, z): what is the meridian's own."""
