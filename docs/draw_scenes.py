"""The page of scenes, and its pictures: ``python docs/draw_scenes.py [NAME ...]``, with ``EXTRAS=view``.

Each study in ``docs/scenes/`` has one case. Its title is a heading of ``docs/scenes.md``, its first comment the text,
and its picture ``docs/figures/scenes/<name>.png``.
"""

import sys
import tomllib
from pathlib import Path

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
)
# Bytes of a picture.
MOST = 150_000

_HEAD = """# Scenes

A picture and a study file for every body and every tool. The mesh is cut open at the contact; the black line is the
sphere of radius ε, red the edge of the tool's footprint. `epsmesh new mine --like docs/scenes/box.toml` starts from
the first of them, and `epsmesh view docs/scenes/box.toml` [draws it](view.md).

<!-- Written by docs/draw_scenes.py from the studies in docs/scenes/. -->
"""


def studies() -> list[Path]:
    """Return the studies, in the order of the page."""
    place = {name: number for number, name in enumerate(ORDER)}
    return sorted(STUDIES.glob("*.toml"), key=lambda path: (place.get(path.stem, len(place)), path.stem))


def page() -> str:
    """Return the page."""
    return "\n".join([_HEAD, *map(_section, studies())])


def _section(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    title = tomllib.loads(text)["title"]
    words = [line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")]
    return f"""## {title}

{" ".join(words)} Study file: [{path.name}](scenes/{path.name}).

![{title}](figures/scenes/{path.stem}.png)
"""


def draw(path: Path) -> Path:
    """Draw the mesh of a study's case, in as few bytes as its colours need."""
    from mpi4py import MPI
    from PIL import Image

    from epsmesh.run.solved import solve_alone
    from epsmesh.study.read import read_study
    from epsmesh.view.compute import compute_fields
    from epsmesh.view.picture import draw_mesh

    study = read_study(path)
    (case,) = study.cases()
    fields = compute_fields(solve_alone(study, case), MPI.COMM_SELF, mesh_only=True)
    assert fields is not None
    PICTURES.mkdir(parents=True, exist_ok=True)
    picture = draw_mesh(fields, PICTURES / f"{path.stem}.png", study.title)
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
