"""What people write that a study has by another name, or not at all: one sentence for each says what to write."""

_YOUNG = "unknown key; Young's modulus is `young`"
_SHEAR = "unknown key; give `young` and `poisson`: young is 2 (1 + poisson) times the shear modulus"
_BULK = "unknown key; give `young` and `poisson`: poisson = (3 K - young) / (6 K) with the bulk modulus K"
_LAME = (
    "unknown key; give `young` = mu (3 lambda + 2 mu) / (lambda + mu) and "
    "`poisson` = lambda / (2 (lambda + mu)) of Lamé's constants"
)
_C1 = (
    "unknown key; give `young`: it is 4 (1 + poisson) C1 of neo-hookean and yeoh, and 4 (1 + poisson) (C1 + C2) of "
    "mooney-rivlin, whose `c2` is C2 / (C1 + C2)"
)
_D1 = "unknown key; give `poisson` = (3 K - young) / (6 K) with the bulk modulus K = 2 / D1"
_ROLLER = "a roller, on which tissue slides, is not computed: give the whole body, whose symmetry is found"
_HELD = f'unknown key; faces that are held are `fixed`, such as fixed = "bottom"; {_ROLLER}'
_RELAXES = "unknown key; write [[material.relaxation]] with `share` and `time`"
_FRICTION = "unknown key; the coefficient of friction is `friction`"
_SIZES = "unknown key; elements have the size `fine` within `epsilon` of the tool, and `coarse` far away"

# Other names of a key, which no similarity of letters finds.
OTHER_NAMES = {
    "diameter": "unknown key; give `radius`, half of the diameter",
    "rho": "unknown key; the density is `density`",
    **dict.fromkeys(("E", "modulus", "elastic_modulus", "youngs_modulus"), _YOUNG),
    **dict.fromkeys(("nu", "poissons_ratio"), "unknown key; Poisson's ratio is `poisson`"),
    **dict.fromkeys(("mu", "G", "shear", "shear_modulus"), _SHEAR),
    **dict.fromkeys(("K", "kappa", "bulk", "bulk_modulus"), _BULK),
    **dict.fromkeys(("lam", "lambda", "lame", "lame_lambda"), _LAME),
    **dict.fromkeys(("c1", "C1", "c10", "C10"), _C1),
    **dict.fromkeys(("C2", "c01", "C01", "c20", "C20"), "unknown key; `c2` is C2 / (C1 + C2), or C2 / C1 of yeoh"),
    **dict.fromkeys(("d1", "D1"), _D1),
    **dict.fromkeys(("prony", "tau", "viscoelastic"), _RELAXES),
    **dict.fromkeys(("supports", "boundary", "bc", "roller", "rollers", "symmetry"), _HELD),
    **dict.fromkeys(("indentation", "displacement"), "unknown key; the depth of the tool is `depth`"),
}
# Those of single sections.
_OF_SECTIONS = {
    "probe": dict.fromkeys(("mu", "friction_coefficient"), _FRICTION),
    "mesh": dict.fromkeys(("size", "h", "element_size"), _SIZES),
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
    **dict.fromkeys(("surface_tension", "surface_energy"), "surface tension and adhesion are not computed"),
    **dict.fromkeys(
        ("permeability", "porosity", "hydraulic_permeability", "diffusivity", "poroelastic"),
        "flow of fluid through tissue is not computed; give what it relaxes as [[material.relaxation]]",
    ),
}

_PUNCH = 'a flat cylindrical punch is shape = "disc"'
_VICKERS = 'the tip of Vickers is shape = "pyramid" with angle = "68 deg" and sides = 4'
_BERKOVICH = 'the tip of Berkovich is shape = "pyramid" with angle = "65.27 deg" and sides = 3'
_PARABOLA = 'a parabolic tip is shape = "paraboloid"'
_EDGE = 'a cutting edge is shape = "blade", a blunt one "wedge"'
_NEEDLE = 'a needle is a "sphere", "cone" or "disc", the form of its end, with [probe.insertion]'
_BALL = 'a ball is shape = "ellipsoid" with three equal `axes`, half of its diameter each'
_HALF = 'a half-space is a "box" or "cylinder" some 20 contact radii wide and high'
# Other names of shapes, by section.
OTHER_SHAPES = {
    "probe": {
        **dict.fromkeys(("cylinder", "cylindrical", "flat", "punch", "flat_punch", "circle", "platen"), _PUNCH),
        **dict.fromkeys(
            ("ball", "bead", "spherical", "hemisphere", "round"), 'a ball or round tip is shape = "sphere"'
        ),
        "vickers": _VICKERS,
        "berkovich": _BERKOVICH,
        **dict.fromkeys(("parabola", "parabolic"), _PARABOLA),
        **dict.fromkeys(("knife", "scalpel", "edge"), _EDGE),
        "needle": _NEEDLE,
        "conical": 'a cone is shape = "cone"',
    },
    "body": {
        **dict.fromkeys(("sphere", "ball"), _BALL),
        **dict.fromkeys(("cube", "cuboid", "block", "slab", "plate", "layer"), 'a block is shape = "box"'),
        **dict.fromkeys(("half-space", "halfspace", "half_space"), _HALF),
        **dict.fromkeys(("disc", "disk", "puck"), 'a round pad is shape = "cylinder"'),
        **dict.fromkeys(("stl", "mesh", "obj", "ply"), 'a closed surface of a file is shape = "surface"'),
        **dict.fromkeys(("mri", "ct", "nifti", "dicom", "labels"), 'an image of labels is shape = "image"'),
        **dict.fromkeys(("step", "iges", "brep"), 'a solid of a CAD file is shape = "cad"'),
    },
}
_SLIDES = '; tissue that slides along a known footprint is contact = "frictionless"'
_STICKS = '; tissue that sticks to a known footprint is contact = "bonded"'
_TOUCHES = '; tissue that may leave the tool is contact = "unilateral"'
# Other names of values, by key.
OTHER_VALUES = {
    "fixed": dict.fromkeys(("roller", "rollers", "sliding", "symmetry"), f"; {_ROLLER}"),
    "contact": {
        **dict.fromkeys(("sliding", "slip", "smooth", "lubricated"), _SLIDES),
        **dict.fromkeys(("tied", "glued", "stick", "sticking", "no-slip", "rough", "adhesive"), _STICKS),
        **dict.fromkeys(("hard", "one-sided", "separation", "signorini", "friction", "frictional"), _TOUCHES),
    },
}
# Other names of sections.
OTHER_SECTIONS = {
    **dict.fromkeys(("indenter", "tool", "punch", "needle", "blade"), "the tool is [probe]"),
    **dict.fromkeys(("tissue", "law", "tissues"), "what tissue is made of is [material]"),
    **dict.fromkeys(("geometry", "domain", "sample", "specimen", "organ"), "the tissue's shape is [body]"),
    **dict.fromkeys(("gravity", "pressure", "boundary"), "gravity and tractions are in [load]"),
    **dict.fromkeys(("solver", "solution"), "how it is solved is in [solve]"),
}


def other_name(section: str, key: str) -> str:
    """Return what to write instead of a ``key`` that people write in a section; "" if it is none of these."""
    own = _OF_SECTIONS.get(section.partition("[")[0].partition(".")[0], {})
    return (OTHER_NAMES | NOT_COMPUTED | own).get(key, "")
