"""What a study gives its readers: the dataset, and the figure beside it."""

from collections.abc import Mapping
from pathlib import Path

from pipeline.plan.plan import Plan
from pipeline.report.dataset import build, write
from pipeline.run.record import Record


def publish(plan: Plan, records: Mapping[str, Record], attributes: Mapping[str, str], output: Path) -> tuple[Path, ...]:
    """Write ``<study>.nc`` and its figure into ``output`` and return the files; ``attributes`` tell of the run."""
    from pipeline.report.figures import draw  # noqa: PLC0415 (matplotlib is slow to load, and wanted last)

    path = output / f"{plan.study.name}.nc"
    dataset = build(plan, records, attributes)
    write(dataset, path)
    return (path, *draw(dataset, path.with_suffix("")))
