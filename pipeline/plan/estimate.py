"""What a case will need, before it is begun: tetrahedra, and memory."""

from math import inf, log, pi

from pipeline.study.sweep import Case

# Volume of gmsh's mean tetrahedron in units of the cube of the size asked for: measured, docs/performance.md.
_TETRAHEDRON = 0.21
# Bytes for each dof at the peak of a solve: the operator and multigrid, or the factor of a system of 50,000 dofs; and
# what two more matrices take. Measured: docs/solvers.md.
_BYTES_PER_DOF = {"iterative": {1: 2500, 2: 1900, 3: 2000, 4: 2800}, "direct": {1: 9000, 2: 9000, 3: 10_000}}
_BYTES_OF_PARTS = {1: 1000, 2: 1500, 3: 2200, 4: 3300}
_BASE = 200e6
# Dofs for each tetrahedron on large meshes, three components.
_DOFS_PER_CELL = {1: 0.55, 2: 4.4, 3: 15.0, 4: 35.0}
# Bytes gmsh and the arrays take for each tetrahedron while meshing.
_BYTES_PER_CELL = 1000


def cells(case: Case) -> float:
    """Estimate the tetrahedra of the case's mesh, within about a factor of two."""
    mesh, probe, body = case.mesh, case.probe, case.body
    rim, growth, thickness = mesh.rim_size(probe.half_width), mesh.growth, body.thickness(case.frame)
    length, area = probe.rim_size
    # Half discs round the rim: ∫ π s / (rim + growth s)³ ds up to the distance where the size is fine.
    total = length * pi * (1 / rim - 1 / mesh.fine) ** 2 * rim / (2 * growth**2) if rim < mesh.fine else 0.0
    # Below an area in which contact may end: ∫ 1 / (rim + growth s)³ ds.
    total += area / (2 * growth * rim**2)
    epsilon = min(mesh.epsilon, (3 * body.volume / (2 * pi)) ** (1 / 3))
    if case.is_full or mesh.epsilon == inf:
        return (total + body.volume / mesh.fine**3) / _TETRAHEDRON
    inside = min(2 / 3 * pi * epsilon**3, body.volume)
    if case.is_truncated and not case.is_closed:
        inside = min(inside, pi * mesh.epsilon**2 * thickness)
        # A column is resolved to half its radius all along.
        total += min(pi * mesh.epsilon**2 * thickness, body.volume) / (mesh.epsilon / 2) ** 3
    total += inside / mesh.fine**3
    if case.is_closed:
        return total / _TETRAHEDRON
    # Shells of size fine + growth (r - ε) round the contact, then coarse.
    total += 2 * pi * epsilon**2 / (2 * growth * mesh.fine**2) + 4 * pi * epsilon / (growth**2 * mesh.fine)
    total += 2 * pi / growth**3 * log(max(mesh.coarse / mesh.fine, 1.0))
    if not case.is_truncated:
        total += max(body.volume - inside, 0.0) / mesh.coarse**3
    return total / _TETRAHEDRON


def dofs(count: float, degree: int) -> float:
    """Estimate the unknowns on ``count`` tetrahedra."""
    return _DOFS_PER_CELL[degree] * count


def solving_memory(dofs: float, degree: int, *, direct: bool, parts: bool = False) -> float:
    """Estimate the bytes that a solve takes, all ranks together; ``parts`` keeps A_λ and A_μ for the next ν."""
    per_dof = _BYTES_PER_DOF["direct" if direct else "iterative"][degree] + parts * _BYTES_OF_PARTS[degree]
    # Fill of a factorisation in 3D grows like dofs^(4/3); the figure above is for 50,000.
    growth = (dofs / 50_000) ** (1 / 3) if direct else 1.0
    return _BASE + per_dof * growth * dofs


def enriched_memory(dofs: float, degree: int, *, parts: bool = False) -> float:
    """Estimate the bytes that an error bar takes: a solve of one degree more than that of ``dofs`` unknowns."""
    growth = _DOFS_PER_CELL[degree + 1] / _DOFS_PER_CELL[degree]
    return solving_memory(growth * dofs, degree + 1, direct=False, parts=parts)


def case_memory(case: Case, share: float = 1.0) -> float:
    """Estimate the bytes for meshing and solving a case that has no mesh yet, within about a factor of two.

    ``share`` is the part of the body that is modelled.
    """
    count = share * cells(case)
    solving = solving_memory(dofs(count, case.mesh.degree), case.mesh.degree, direct=case.solve.method == "direct")
    return max(_BASE + _BYTES_PER_CELL * count, solving)
