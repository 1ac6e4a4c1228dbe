"""The commands that show a dataset: figures, report."""

from typing import Annotated

import typer

from pipeline.cli.console import print_json
from pipeline.cli.faults import Fault, fail, of_option
from pipeline.cli.words import DEFAULT_OUTPUT, Dataset, Found, Json, check_machine, check_output, read_dataset

# Bytes that a page may take: figures, parts of the first one and some thousand cases; a scene besides.
_PAGE, _PAGE_WITH_SCENE = 6_000_000, 12_000_000

# No scene at all.
_NONE = "none"


def plot(
    file: Dataset,
    output: Found = DEFAULT_OUTPUT,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            help="A figure to draw; may be repeated: ratio, error, force, map, compliance. Default: all that suit.",
            show_default=False,
        ),
    ] = None,
    rest: Annotated[
        bool, typer.Option("--rest", help="Draw what a figure of a large study leaves out, too: <study>_<kind>_2.png …")
    ] = False,
    as_json: Json = False,
) -> None:
    """Draw the figures of a dataset, as PNG and SVG, beside it.

    The study's main figure is <study>.png, the others <study>_<kind>.png.

    Example: epsmesh plot results/figure3.nc

    Example: epsmesh plot studies/figure3.toml --kind error --kind force
    """
    path, dataset = read_dataset(file, output)
    from pipeline.report.figures import KINDS, choose, draw, files, lacks

    for name in kind or ():
        if name not in KINDS:
            fail(of_option("--kind", name, f"no figure is called so; there are {', '.join(KINDS)}"))
        if lack := lacks(dataset, name):
            allowed = f"{lack}; its figures are {', '.join(choose(dataset))}"
            fail(Fault(f"{path}: --kind {name} {allowed}", str(path), "--kind", name, allowed))
    stem, kinds = path.with_suffix(""), kind or choose(dataset)
    check_output(*(picture for some in files(dataset, stem, kinds=kinds).values() for picture in some))
    pictures = draw(dataset, stem, kinds=kinds, rest=rest)
    if as_json:
        print_json({"file": str(path), "files": [str(picture) for picture in pictures]})
        return
    for picture in pictures:
        print(picture)


def report(
    file: Dataset,
    output: Found = DEFAULT_OUTPUT,
    scene: Annotated[
        str | None,
        typer.Option(
            help='A case to turn round on the page, "poisson=0.3, epsilon=10 mm", its number, "answer", that of the '
            'report, or "none": meshed, not solved. Default: the answer\'s, where that takes seconds.',
            show_default=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the report of a dataset, one HTML page that needs nothing else, beside it: <study>.html.

    It holds the figures, a table of the cases to sort and filter, what failed or was skipped and why, the study file,
    and how to run it again.

    Example: epsmesh report results/figure3.nc

    Example: epsmesh report results/figure3.nc --scene "epsilon=10 mm"

    Example: epsmesh report results/figure3.nc --scene none
    """
    path, dataset = read_dataset(file, output)
    wanted = (scene or "").strip()
    check_output(path.with_suffix(".html"), room=_PAGE if wanted in ("", _NONE) else _PAGE_WITH_SCENE)
    if wanted not in ("", _NONE):
        check_machine()
    from pipeline.cli.scene import scene_at_hand, scene_of
    from pipeline.report.page import write_page

    shown = "" if wanted == _NONE else scene_of(path, dataset, wanted) if wanted else scene_at_hand(dataset)
    page = write_page(dataset, path.with_suffix(".html"), shown)
    if as_json:
        print_json({"file": str(path), "page": str(page)})
    else:
        print(page)
