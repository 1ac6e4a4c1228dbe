"""Commands that this package adds: `epsmesh export` and `epsmesh touch`."""
