"""The page of scenes, and its pictures: ``python docs/draw_scenes.py [NAME ...]``, with Chromium installed.

Each study in ``docs/scenes/`` has one case, with the picture ``docs/figures/scenes/<name>.png`` and a link in
``docs/scenes.md``.
"""

import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

DOCS = Path(__file__).parent
PAGE, STUDIES, PICTURES = DOCS / "scenes.md", DOCS / "scenes", DOCS / "figures" / "scenes"
# In the order of the page; studies that are not named here follow by their names.
ORDER = (
    "box",
    "blade",
    "incision",
    "cylinder",
    "column",
    "layers",
    "tumour",
    "ellipsoid",
    "sphere",
    "rounded",
    "cone",
    "paraboloid",
    "pyramid",
    "wedge",
    "tilted",
    "cad",
    "organ",
    "organ-tumour",
    "image",
    "support",
    "grasp",
    "organ-grasp",
)
# Bytes of a picture.
MOST = 150_000
# Draws on the processor, once the scripts of the page are done.
BROWSER = (
    "chromium", "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage", "--hide-scrollbars", "--window-size=900,560", "--virtual-time-budget=10000",
)  # fmt: skip

_HEAD = """# Scenes

Each body and each tool, with its study file. The mesh is cut open at the contact; the black line is the sphere of
radius ε, red where the tool touches. `epsmesh new mine --like docs/scenes/box.toml` starts from one of them.

<!-- Written by docs/draw_scenes.py from the studies in docs/scenes/. -->

| | |
|---|---|
"""


def studies() -> list[Path]:
    """Return the studies, in the order of the page."""
    place = {name: number for number, name in enumerate(ORDER)}
    return sorted(STUDIES.glob("*.toml"), key=lambda path: (place.get(path.stem, len(place)), path.stem))


def page() -> str:
    """Return the page: two scenes a row."""
    cells = [*map(_cell, studies()), ""]
    return _HEAD + "".join(f"| {left} | {right} |\n" for left, right in zip(cells[::2], cells[1::2], strict=False))


def _cell(path: Path) -> str:
    title = tomllib.loads(path.read_text(encoding="utf-8"))["title"]
    return f"![{title}](figures/scenes/{path.stem}.png) [{title}](scenes/{path.name})"


def draw(path: Path) -> Path:
    """Draw the page of a study's case in a browser without a window, in as few bytes as its colours need."""
    from mpi4py import MPI
    from PIL import Image

    from epsmesh.run.solved import solve_alone
    from epsmesh.study.read import read_study
    from epsmesh.view.compute import compute_fields
    from epsmesh.view.page import render

    study = read_study(path)
    (case,) = study.cases()
    fields = compute_fields(solve_alone(study, case), MPI.COMM_SELF, mesh_only=True)
    assert fields is not None
    PICTURES.mkdir(parents=True, exist_ok=True)
    picture = PICTURES / f"{path.stem}.png"
    with TemporaryDirectory() as folder:
        page = Path(folder) / "scene.html"
        page.write_text(render(fields, study.title).replace('id="panel" open', 'id="panel" hidden'), encoding="utf-8")
        subprocess.run(
            [*BROWSER, f"--user-data-dir={folder}", f"--screenshot={picture}", page.as_uri()],
            check=True,
            stderr=subprocess.DEVNULL,
        )
    with Image.open(picture) as image:
        colours = image.convert("RGB").quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    colours.save(picture, optimize=True)
    if picture.stat().st_size > MOST:
        raise SystemExit(f"{picture} has {picture.stat().st_size} bytes, more than {MOST}: take larger elements")
    return picture


if __name__ == "__main__":
    wanted = sys.argv[1:]
    for study_file in studies():
        if not wanted or study_file.stem in wanted:
            print(draw(study_file))
    PAGE.write_text(page(), encoding="utf-8")
