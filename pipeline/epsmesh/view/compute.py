"""From a case to the fields that show it: meshed, solved if asked for, gathered on the first rank, made whole."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.reflect import reflect, reflect_vectors
from epsmesh.plan.steps import Solve
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.run.fields import moduli_of
from epsmesh.run.map_resolution import change_with_wider_voxels
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.solved import Solved, modelled_arrays, solve_fields
from epsmesh.run.tools import beds_on
from epsmesh.scene.model import BELOW, PROBE, TOOL
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.shapes.section import in_mm
from epsmesh.solve.cell_values import CellValues
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.points.state import State
from epsmesh.view.fields import Fields
from epsmesh.view.lagrange import nodes_of, stresses_of
from epsmesh.view.pressure import pressures_of

Note = Callable[[str], None]
# Forces besides that of the tool.
_BESIDES = ("jaw_force", "pull_force", "jaw_pull_force", "support_force", "interface_force")


def compute_fields(
    solve: Solve,
    comm: MPI.Comm,
    *,
    mesh_only: bool = False,
    bar: bool = False,
    stress: bool = False,
    cache: MeshCache | None = None,
    note: Note = lambda text: None,
) -> Fields | None:
    """Return the fields of a case, on rank 0 (None elsewhere); collective.

    See :func:`epsmesh.run.solved.solve_fields`; with ``mesh_only``, the fields are those of the first mesh. With
    ``stress`` they have the stress and the nodes of the elements.
    """
    if mesh_only:
        arrays = modelled_arrays(solve, comm, cache, note)
        return _whole(solve, arrays) if arrays is not None else None
    has_image = any(tissue.varying is not None and tissue.varying.file is not None for tissue in solve.case.tissues)
    solved = solve_fields(solve, comm, bar=bar, influence=has_image, cache=cache, note=note)
    if wider := change_with_wider_voxels(solved):
        size, change = wider
        note(
            f"material.young: with voxels of {in_mm(2 * size)} in place of {in_mm(size)}, F would change by about "
            f"{100 * change:+.2g} %"
        )
    return fields_of(solved, stress=stress)


def fields_of(solved: Solved, *, stress: bool = False) -> Fields | None:
    """Return the fields of a solution, on rank 0 (None elsewhere); collective.

    ``stress``: see :func:`compute_fields`.
    """
    arrays, record = solved.arrays, solved.record
    points = solved.state.body.comm.bcast(len(arrays.points) if arrays is not None else 0)
    displacement, strain = _gathered(solved.state, points)
    mirrors = solved.solve.mirrors
    nodes = nodes_of(solved.state, mirrors) if stress else None
    stresses = stresses_of(solved.state, mirrors) if stress else None
    case, pressure = solved.solve.case, dict[str, FloatArray]()
    if case.way.is_found:
        others = [name for name, found in ((BELOW, case.body.loose), (TOOL, case.probe.elastic)) if found]
        pressure = pressures_of(solved.state, arrays, (PROBE, *beds_on(case), *others), mirrors)
    if arrays is None:
        return None
    fields = _whole(solved.solve, arrays, displacement, strain)
    return replace(
        fields,
        dofs=solved.dofs,
        force=record.force,
        force_error=record.force_error,
        on_meridian=solved.on_meridian,
        nodes=nodes,
        stress=stresses,
        pressure=pressure,
        besides={
            name: (record.largest[name], record.largest[f"{name}_error"]) for name in _BESIDES if name in record.largest
        },
    )


def _gathered(state: State, points: int) -> tuple[FloatArray, FloatArray]:
    """Return, on rank 0, the displacement of every point of the mesh as it was made, and the strain of every cell.

    A displacement of higher degree is interpolated to the order of the mesh: exact at its nodes. It counts from the
    shape that the study gives.
    """
    mesh, displacement = state.body, state.displacement
    principal = CellValues(mesh, displacement, is_mixed=state.pressure is not None).principal_strains(state.law)
    owned = mesh.owned_cells
    order = 1 if compat.geometry_dofs(mesh.mesh).shape[1] == 4 else 2
    nodal = fem.Function(vector_space(mesh.mesh, order))
    nodal.interpolate(displacement)
    # Nodes of the geometry and dofs of that order come in the same order within a cell.
    nodes = compat.geometry_dofs(mesh.mesh)[:owned].reshape(-1)
    dofs = compat.cell_dofs(nodal.function_space)[:owned].reshape(-1)
    numbers, first = np.unique(_input_numbers(mesh.mesh)[nodes], return_index=True)
    values = np.asarray(nodal.x.array).reshape(-1, 3)[dofs[first]]
    values += (mesh.mesh.geometry.x - mesh.shown)[nodes[first]]
    strain = np.abs(principal).max(axis=1)
    at_points = _assembled(mesh.comm, points, numbers, values)
    return at_points, _assembled(mesh.comm, mesh.cells, compat.original_cells(mesh.mesh)[:owned], strain)


def _input_numbers(mesh: Any) -> IntArray:
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def _assembled(comm: MPI.Comm, size: int, numbers: IntArray, values: FloatArray) -> FloatArray:
    """Return, on rank 0, one array of every rank's ``values``, each at its number; collective."""
    result = np.empty((size if comm.rank == 0 else 0, *values.shape[1:]))
    for place, content in comm.gather((numbers, values)) or ():
        result[place] = content
    return result


def _whole(
    solve: Solve, arrays: MeshArrays, displacement: FloatArray | None = None, strain: FloatArray | None = None
) -> Fields:
    """Reflect what was modelled into the whole body."""
    case, mirrors = solve.case, solve.mirrors
    if displacement is not None:
        displacement = reflect_vectors(arrays, displacement, mirrors)
    if strain is not None:
        strain = np.tile(strain, 2 ** len(mirrors))
    whole = reflect(arrays, mirrors)
    points = whole.points + np.subtract(case.frame.point, solve.meshed_case.frame.point)
    planes = tuple(plane for plane in mirror_planes(case) if plane != MIDDLE)
    fields = Fields(case, points, whole.cells, whole.facets, planes, displacement, strain)
    if case.varies:
        young = moduli_of(case, fields.centres, whole.regions)
        is_known = young > 0  # in a mesh alone, some may lack
        fields = replace(fields, young=np.where(is_known, young, young[is_known].min()) if is_known.any() else None)
    if whole.regions is None:
        return fields
    # Where layers fill the body nothing is left of the tissue that has number 0.
    present, regions = np.unique(whole.regions, return_inverse=True)
    return replace(fields, regions=regions, region_names=tuple(case.region_names[number] for number in present))
