"""What this package adds to epsmesh, as :mod:`epsmesh.extensions` finds it: sections of a study, a kind of dataset."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from epsmesh.extensions import Forecast, Kind, Made, RefusedError, Sections
from epsmesh.study.sweep import Study
from epsmesh_identify.sections.columns import Columns, ColumnUnits, Sign
from epsmesh_identify.sections.kept import measurements_of, spread_of
from epsmesh_identify.sections.measurement import Identify, Measurement, Sensitivity
from epsmesh_identify.sections.read import fill, read

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.plan.cost import CostModel

# A range, or a value with its error.
_PLAIN_VALUE = {"type": ["string", "number"]}
_SOUGHT = {
    "anyOf": [
        {"type": "array", "items": _PLAIN_VALUE, "minItems": 2, "maxItems": 2},
        {
            "type": "object",
            "properties": {"value": _PLAIN_VALUE, "error": _PLAIN_VALUE},
            "required": ["value", "error"],
            "additionalProperties": False,
        },
    ]
}


_TEXTS = {
    "measurement": "Measured force curves, one table each, for `epsmesh identify`. Forces do not depend on them. "
    "Optional; their lists are no sweeps.",
    "measurement.columns": "Columns of the file, by header or by number from 1. A header's unit is read: `depth / nm`, "
    "`load (µN)`, `Z [mm]`. Optional; columns that are not named are found where unmistakable, and reported.",
    "measurement.units": "Units of columns whose headers have none. Optional; a unit that contradicts the header is "
    "an error.",
    "measurement.sign": "Signs of recorded values. Optional; a sign that is not given is found, and reported.",
    "identify": "Unknowns that `epsmesh identify` finds from the measurements. Besides the keys below, the name of a "
    "parameter is a key: `young`, of a field `scale`, its factor, `poisson`, `thickness`, `radius`, `friction`, "
    "`skin_young`, `skin_thickness`, a parameter of the law, `contact_point` (larger is deeper), `baseline`, `drift`, "
    "`machine_stiffness`, `relaxation_share_1`, `relaxation_time_1`. It has a range, or a value with its error (95 %). "
    "What is not named is known. Optional; its lists are no sweeps.",
    "sensitivity": "Parameters whose effect on the force `epsmesh run` compares, after the cases. Besides the key "
    "below, the name of a parameter is a key, as in [identify], and `depth`: it has a range, or a value with its error "
    "(95 %). Forces do not depend on this section. Optional; its lists are no sweeps.",
}


def left_out(study: Study) -> str:
    """Say that measurements are."""
    return "its measurements are for `epsmesh identify`: only its cases are run" if measurements_of(study) else ""


def forecast(study: Study, cost: "CostModel") -> Iterator[Forecast]:
    """Yield what the tables of forces cost that an identification and a sensitivity need.

    Raises:
        StudyError: if a scene cannot be run.
        RefusedError: if the depths are those of files that are no curves.
    """
    if not (measurements_of(study) or spread_of(study).varied):
        return
    from epsmesh_identify.experiment.reading import ExperimentError  # noqa: PLC0415 (surrogates are slow to load)
    from epsmesh_identify.forecast import forecasts  # noqa: PLC0415

    try:
        yield from forecasts(study, cost)
    except ExperimentError as wrong:
        raise RefusedError(str(wrong)) from wrong


def is_identification(dataset: "xr.Dataset") -> bool:
    """Tell the dataset of an identification from others."""
    return {"estimate", "part", "seen"} <= {*dataset.data_vars}


def write_page(dataset: "xr.Dataset", path: Path) -> Path:
    """Write the report of an identification."""
    from epsmesh_identify.report.page import write_page as write  # noqa: PLC0415 (figures are slow to load)

    return write(dataset, path)


def draw(dataset: "xr.Dataset", stem: Path) -> list[Path]:
    """Draw the figure of an identification."""
    from epsmesh_identify.report.figures.identification import draw as drawn  # noqa: PLC0415

    return drawn(dataset, stem)


def is_sensitivity(dataset: "xr.Dataset") -> bool:
    """Tell the dataset of Sobol's indices from others."""
    return {"first", "total", "surrogate_error"} <= {*dataset.data_vars}


def write_sensitivity(dataset: "xr.Dataset", path: Path) -> Path:
    """Write the report of Sobol's indices."""
    from epsmesh_identify.report.page import write_sensitivity as write  # noqa: PLC0415

    return write(dataset, path)


def draw_sensitivity(dataset: "xr.Dataset", stem: Path) -> list[Path]:
    """Draw the figure of Sobol's indices."""
    from epsmesh_identify.report.figures.sensitivity import draw as drawn  # noqa: PLC0415

    return drawn(dataset, stem)


def further(study: Study, output: Path) -> Callable[[Path], Made] | None:
    """Return what makes the sensitivity of a study; None without the section."""
    from epsmesh_identify.cli.sensitivity import sensitivity_of  # noqa: PLC0415

    return sensitivity_of(study, output)


def following(study: Study, store: Path, quiet: bool) -> Made:
    """Rank which test to make next."""
    from epsmesh_identify.cli.design import ranking  # noqa: PLC0415

    return ranking(study, store, quiet)


SECTIONS = Sections(
    models={"measurement": Measurement, "identify": Identify, "sensitivity": Sensitivity},
    texts=_TEXTS,
    read=read,
    tables={"measurement": {"columns": Columns, "units": ColumnUnits, "sign": Sign}},
    arrays=("measurement",),
    others={"identify": _SOUGHT, "sensitivity": _SOUGHT},
    pages={"measurement": "guide/identify", "identify": "guide/identify"},
    fill=fill,
    left_out=left_out,
    forecast=forecast,
    further=further,
    following=following,
)

IDENTIFICATION = Kind("an identification", "identification of curves", is_identification, write_page, draw)
SENSITIVITY = Kind(
    "a sensitivity", "sensitivity of forces to parameters", is_sensitivity, write_sensitivity, draw_sensitivity
)
