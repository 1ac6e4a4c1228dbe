"""Results of single files, kept as they come: an interrupted identification of many files goes on where it was."""

from hashlib import sha256
from pathlib import Path

import xarray as xr

from epsmesh import __version__
from epsmesh.run.provenance import git_commit
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.dataset import write
from epsmesh_identify.estimation.experiment import Specimen, cases_of


class Kept:
    """The folder of what is known of a study's files; names in it follow from program, study, bodies and curves."""

    def __init__(self, output: Path, study: Study):
        self._folder = output / "identified"
        # With what is in the files that the study names.
        read = {
            " ".join(
                (
                    case.body.model_dump_json(),
                    case.material.model_dump_json(),
                    *(tissue.varying.identity for tissue in case.tissues if tissue.varying),
                )
            )
            for case in cases_of(study)
        }
        self._study = "\n".join((f"{__version__} {git_commit()}", study.text, *sorted(read)))

    def read(self, specimen: Specimen) -> xr.Dataset | None:
        """Return what was kept of a specimen, None if nothing was, or if it cannot be read."""
        path = self._path(specimen)
        try:
            return xr.load_dataset(path, engine="netcdf4") if path.is_file() else None
        except (OSError, ValueError, RuntimeError):
            return None

    def write(self, specimen: Specimen, found: xr.Dataset) -> None:
        """Keep what was found of a specimen.

        Raises:
            OSError: if it cannot be written.
        """
        write(found, self._path(specimen))

    def _path(self, specimen: Specimen) -> Path:
        digest = sha256(self._study.encode())
        for curve in specimen.curves:
            for values in (curve.depth, curve.force, curve.time):
                digest.update(b"none" if values is None else values.tobytes())
        return self._folder / f"{digest.hexdigest()[:24]}.nc"
