"""Names that the command line and study files share."""

REDUCTIONS = (
    "duplicates",
    "full",
    "scaling",
    "images",
    "moved",
    "axisymmetric",
    "symmetry",
    "sharing",
    "reuse",
    "reduced",
    "condensed",
    "path",
    "stored",
    "all",
)

# Other names of a key, which no similarity of letters finds.
OTHER_NAMES = {
    "diameter": "unknown key; give `radius`, half of the diameter",
    "E": "unknown key; Young's modulus is `young`",
    "nu": "unknown key; Poisson's ratio is `poisson`",
    "rho": "unknown key; the density is `density`",
}

# Keys of features that are not computed. A message says so, instead of suggesting a similar key.
NOT_COMPUTED = {
    "adhesion": 'adhesion is not computed; with contact = "bonded", the tool pulls as well as it presses',
    "velocity": "the speed of the tool is given by `ramp` in [probe.history]; inertia is not computed",
    "speed": "the speed of the tool is given by `ramp` in [probe.history]; inertia is not computed",
    "viscosity": "viscosity is given as `relaxation` of [material]: shares of the modulus, and their times",
    "damping": "damping is given as `relaxation` of [material]: shares of the modulus, and their times",
    "plasticity": "plasticity is not computed: materials are elastic",
    "yield": "plasticity is not computed: materials are elastic",
    "anisotropy": 'anisotropy is not computed for itself: fibres are part of law = "holzapfel"',
    "temperature": "temperature is not computed",
}

# Each is drawn by the module of its name in pipeline/report/figures.
FIGURES = ("insertion", "history", "ratio", "error", "force", "map", "compliance")
