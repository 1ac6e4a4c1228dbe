"""What neo-Hookean bodies are solved for: what no code was written for is refused, and nothing solved as if linear."""

from collections.abc import Sequence

from pipeline.shapes.body import Body
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import in_mm
from pipeline.study.problems import Problems
from pipeline.study.schema import Material, Mesh

_LAW = 'law = "neo-hookean"'


def check_large(
    bodies: Sequence[Body],
    materials: Sequence[Material],
    probes: Sequence[Probe],
    meshes: Sequence[Mesh],
    problems: Problems,
) -> None:
    """Report what neo-Hookean materials do not go with."""
    large = [material for material in materials if material.is_large]
    if not large:
        return
    for material in large:
        least, most = material.OF_LARGE
        if not least <= material.poisson <= most:
            problems.error(
                "material.poisson", material.poisson, f"must be {least} to {most} with {_LAW}: below, tissue gives way "
                "at the probe's edge, and elements of displacements alone lock above",
            )  # fmt: skip
    for body in bodies:
        if body.regions:
            problems.error("material.law", large[0].law, "takes bodies of one material: no layers, no inclusions")
    for probe in probes:
        with problems.about(probe=probe):
            _check_probe(probe, problems)
    for mesh in meshes:
        with problems.about(mesh=mesh):
            _check_mesh(mesh, problems)


def _check_probe(probe: Probe, problems: Problems) -> None:
    if isinstance(probe, Indenter):
        problems.error(
            "probe.shape", probe.shape, f"finds its contact, which is for linear elasticity, not for {_LAW}: use a "
            "disc, an ellipse or a blade",
        )  # fmt: skip
    elif probe.contact != "bonded":
        problems.error("probe.contact", probe.contact, f'must be "bonded" with {_LAW}')
    if probe.motion != "press":
        problems.error("probe.motion", probe.motion, f'must be "press" with {_LAW}: one stiffness says nothing then')
    if probe.slit is not None:
        problems.error("probe.incision", in_mm(probe.slit.depth), f"is for linear elasticity, not for {_LAW}")
    elif (slide := getattr(probe, "slice", 0.0)) != 0.0:
        problems.error("probe.slice", in_mm(slide), f"must be 0 mm with {_LAW}: the blade is pressed in only")


def _check_mesh(mesh: Mesh, problems: Problems) -> None:
    if mesh.element == "mixed":
        problems.error("mesh.element", mesh.element, f'must be "auto" or "displacement" with {_LAW}')
    if mesh.accuracy is not None:
        problems.error("mesh.accuracy", mesh.accuracy, f"is for linear elasticity: with {_LAW} give sizes")
    if mesh.outside not in ("coarse", "free", "fixed"):
        problems.error("mesh.outside", mesh.outside, f'must be "coarse", "free" or "fixed" with {_LAW}')
