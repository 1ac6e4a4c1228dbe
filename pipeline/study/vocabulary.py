"""Names that options of the command line share with the keys of a study file."""

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
    "stored",
    "all",
)

# Keys of features that are not computed: named as such, not taken for slips of the pen.
NOT_COMPUTED = {
    "friction": 'friction is not computed: tissue sticks (contact = "bonded") or slides ("frictionless")',
    "adhesion": 'adhesion is not computed: contact = "bonded" pulls as well as it presses',
    "velocity": "forces are static: nothing depends on velocity",
    "speed": "forces are static: nothing depends on speed",
    "history": "forces are static: a depth has one force, whatever came before it",
    "relaxation": "viscoelasticity is not computed: forces are static",
    "viscosity": "viscoelasticity is not computed: forces are static",
    "damping": "viscoelasticity is not computed: forces are static",
    "plasticity": "plasticity is not computed: materials are elastic",
    "yield": "plasticity is not computed: materials are elastic",
    "fibres": "anisotropy is not computed: materials are isotropic",
    "anisotropy": "anisotropy is not computed: materials are isotropic",
    "toughness": "fracture is not computed: a slit does not grow, and energy_release tells what would drive it",
    "insertion": "fracture is not computed: a blade stands in a slit that is there, `incision` deep",
    "temperature": "temperature is not computed",
}

# Each is drawn by the module of its name in pipeline/report/figures.
FIGURES = ("ratio", "error", "force", "map", "compliance")
