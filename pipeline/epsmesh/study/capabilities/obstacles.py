"""Obstacles: of each shorter way of computing, the features that exclude it, each with the reason.

A way is a reduction, a dataset's variable or a real-time model. A scene with an obstacle is computed the long way.
"""

from epsmesh.study.capabilities.features import FEATURES, Scene

_PRESSED_ONLY = "real-time models are only for tools that press straight down"
# Of each way that may be shorter, the features with which it is not taken, each with the reason; {key} is what sets it.
OBSTACLES: dict[str, dict[str, str]] = {
    "meridian": {
        "fibres": "fibres have a direction, and are not axisymmetric",
        "linear outside": "the boundary of the linear part is a sphere, and no line of the mesh of the meridian",
        "six motions": "most of the six motions are not axisymmetric",
        "half ball": "a half ball is coupled to its far field in three dimensions",
        "stiffness that is not round": "only a formula of r and z alone is axisymmetric",
        "loads": "loads are computed in three dimensions",
        "terms": "terms are computed in three dimensions",
        "inclined touch of a linear law": "contact off the tool's axis is computed in three dimensions",
        "outputs": "outputs are numbers of a solution in three dimensions",
        "influence": "the influence is that of a solution in three dimensions",
    },
    # Taken if no case of the study is in the way: what is compared is computed alike.
    "meridian, in a comparison": {
        "linear outside": "all cases of the comparison are solved in three dimensions",
        "half ball": "all cases of the comparison are solved in three dimensions",
    },
    "reduced basis": {
        "layers": "a body of several materials has more than one parameter",
        "inclusion": "a body of several materials has more than one parameter",
        "region": "a body of several materials has more than one parameter",
        "varying stiffness": "a field of the modulus is another material in each cell",
        "unilateral contact": "the contact area changes with Poisson's ratio",
        "half ball": "the far field changes with Poisson's ratio",
        "large displacements": "the problem is nonlinear",
        "slit": "a slit has results besides F",
        "loads": "loads have results besides F",
        "terms": "the problem is solved as at large displacements",
        "time steps": "a history in time steps is no static solution",
        "outputs": "outputs need the solution of each case",
        "influence": "the influence needs the solution of each case",
    },
    "scaling": {
        "needle that cuts": "its crack depends on the toughness over the modulus",
        "loads": "their force is not proportional to modulus and depth",
        "terms": "F is not proportional to modulus and depth",
        "outputs": "outputs of a function need the solution of each case",
    },
    "mirrored": {
        "fibres": "the direction of the fibres differs in a mirror image",
        "varying stiffness": "the field of the modulus differs in a mirror image",
        "six motions": "the 6 × 6 stiffness differs in a mirror image",
        "loads": "loads break the symmetry",
        "terms": "a term may break the symmetry",
        "outputs": "outputs are at the same place of the body, not of its image",
        "influence": "the shares are those of named regions, not of their images",
    },
    "equivalent places": {
        "fibres": "the direction of the fibres is fixed in the body",
        "varying stiffness": "the field of the modulus is fixed in the body",
        "inclusion": "the distance to the inclusion differs",
        "region": "the distance to the region differs",
        "loads": "loads act on the whole body",
        "terms": "terms act on the whole body",
        "Green's function": "the Green's function of the body depends on the place",
        "outputs": "outputs are at the same place of the body",
    },
    "proportional depths": {
        "loads": "their force is not proportional to the depth",
        "terms": "F is not proportional to the depth",
        "large displacements": "F is not proportional to the depth",
        "inclined touch of a linear law": "F is not proportional to the depth",
        "outputs": "outputs of a function need the solution of each depth",
    },
    "path": {
        "given force": "the depth at the given force is found at each place",
        "F_exact": "F_exact is computed at each place (exact = false omits it)",
        "history": "a history needs the solution of each place",
        "insertion": "an insertion needs the states of each place",
        "needle that cuts": "an insertion needs the states of each place",
        "six motions": "the 6 × 6 stiffness needs the solution of each place",
        "slit": "a slit has results besides F",
        "loads": "loads have results besides F",
        "terms": "terms act on the whole body",
        "outputs": "outputs need the solution of each place",
        "influence": "the influence needs the solution of each place",
    },
    "F_exact": {
        "time steps": "F_exact is static, and these forces are no multiples of static ones",
        "friction": "with friction, F_exact would not be more accurate than F on a fine mesh",
        "terms": "F_exact is of the body on a fixed support and a rigid tool alone",
        "large displacements": "at large displacements, F_exact would not be more accurate than F on a fine mesh",
        "inclined touch of a linear law": "beside the tool's axis, F_exact would not be more accurate than F on a fine "
        "mesh",
    },
    "SOFA scene": {
        "large displacements": "material.law: a scene of SOFA is for linear tissue",
        "varying stiffness": "{key}: a scene of SOFA has one modulus for each region",
        "relaxation": "material.relaxation: a scene of SOFA is static",
        "loads": "[load]: a scene of SOFA has the tool's force alone",
        "grasp": "probe.together: a scene of SOFA has one tool",
        "terms": "[load], body.capsule, body.support, probe.young: a scene of SOFA has tissue and a rigid tool alone",
        "half ball": 'mesh.epsilon: the far field of a half ball has no counterpart in SOFA: use epsilon = "full"',
        "six motions": "probe.motion: a scene of SOFA has one motion",
        "slit": "probe.incision: a scene of SOFA has no slit",
        "insertion": "probe.insertion: a scene of SOFA has one state, without a path",
    },
    "real-time model": {
        "given force": "probe.force: a real-time model has its force for every depth. Give a depth",
        "rounded edge": "probe.edge: real-time models have sharp edges. Omit it",
        "friction": "probe.friction: real-time models are frictionless, `epsmesh.realtime.Friction` adds it. Omit it",
        "loads": "[load]: gravity, tractions and pressure in hollow regions have no real-time model",
        "terms of loads": "[load]: springs and other terms have no real-time model",
        "capsule on the surface": "{key}: a capsule holds the face against motion along it, and close to the tool the "
        "tissue is then no half-space, as a real-time model has it. Capsules of inner regions have a model",
        "capsule that wrinkles": "{key}: real-time models are linear, and a capsule that wrinkles is not. Omit it",
        "tension of the capsule": "{key}: a tension acts before the tool does, and a real-time model begins at rest. "
        "Omit the tension",
        "capsule of a hollow region": "{key}: capsules of hollow regions have no real-time model. Omit it",
        "support that lets go": "body.support: a real-time model has a fixed support. Give body.fixed",
        "loose layer": "{key}: in a real-time model all tissue is bonded. Omit it",
        "tool that deforms": "probe.young: a real-time model has a rigid tool. Omit it",
        "grasp": "probe.together: a real-time model has one tool. Omit the second [[probe]] table",
        "fibres": "{key}: fibres have a direction, and the half-space of a real-time model has none",
        "varying stiffness": "{key}: the half-space of a real-time model has one modulus. Give a value",
        "time steps": "material.relaxation: all tissue of a real-time model relaxes alike. Omit the relaxation of "
        "layers and inclusions",
        "slit": f"probe.incision: {_PRESSED_ONLY}",
        "six motions": f'probe.motion = "all": {_PRESSED_ONLY}',
        "slice": f"probe.slice: {_PRESSED_ONLY}",
    },
}


def obstacle(way: str, scene: Scene) -> str:
    """Return why a scene excludes a shorter way of computing; "" if it does not."""
    name = next((name for name in OBSTACLES[way] if FEATURES[name].holds(scene)), "")
    return OBSTACLES[way][name].replace("{key}", FEATURES[name].told(scene)[0]) if name else ""
