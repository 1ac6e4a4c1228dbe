"""Material parameters from measured force curves, and what the spread of parameters makes of a force.

It asks :mod:`epsmesh` for forces of cases, and adds its sections of a study file, commands and pages to it by entry
points: see :mod:`epsmesh.extensions` and :mod:`epsmesh_identify.extension`.
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.api import RunnableStudy

__all__ = ["identify"]


def identify(
    study: "RunnableStudy", *, output: str | Path = "results", store: str | Path | None = None
) -> "xr.Dataset":
    """Find the parameters of a study from its measured curves, and return the dataset of what was found.

    ``study`` is what ``epsmesh.read`` returns; ``study.identify()`` is the same. Writes ``<study>.nc`` and its figure
    into ``output``; forces are cases of ``store`` (``cases.sqlite`` in ``output``), computed once.

    Raises:
        ValueError: if the study has no measurements.
        FileExistsError: if the dataset of a run would be replaced.
        ExperimentError: if a file is no force curve.
        StudyError: if the scene of a measurement cannot be run.
        SurrogateError: if a case that the forces need has none.
    """
    from epsmesh.files import STORE_NAME  # noqa: PLC0415 (nothing is loaded before it is needed; MPI starts then)
    from epsmesh.launcher import is_first_rank  # noqa: PLC0415
    from epsmesh.report.read import check_kind  # noqa: PLC0415
    from epsmesh_identify.estimation.dataset import write  # noqa: PLC0415
    from epsmesh_identify.estimation.run import identification  # noqa: PLC0415
    from epsmesh_identify.report.figures.identification import draw  # noqa: PLC0415
    from epsmesh_identify.sections.kept import measurements_of  # noqa: PLC0415

    declared = study.declared
    if not measurements_of(declared):
        raise ValueError(f"{declared.file}: has no [[measurement]]")
    path = Path(output) / f"{study.name}.nc"
    check_kind(path, "identification")
    dataset = identification(declared, Path(output), Path(store or Path(output) / STORE_NAME), lambda _: None)
    if is_first_rank():
        write(dataset, path)
        draw(dataset, path.with_suffix(""))
    return dataset
