"""The scale of a field of the modulus, from curves that a stiffer field makes."""

import numpy as np
import pytest
import xarray as xr

from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh_identify.estimation.forward import forward_of
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.report.identified import is_passed_on, material
from tests.cases import raw, solve
from tests.identifications import identification
from tests.identify.estimation.synthetic import noise
from tests.identify.surrogate.scenes import solved_by
from tests.solve.test_round_fields import CYLINDER, LUMP

SCALE = 1.3
STUDY = """
[body]
shape = "cylinder"
radius = "20 mm"
height = "10 mm"
fixed = "bottom"
{layer}
[material]
young = {{formula = "{formula}"}}
poisson = 0.3

[probe]
shape = "disc"
radius = "3 mm"
contact = "frictionless"

[[measurement]]
file = "punch.csv"
machine_stiffness = "rigid"

[identify]
scale = [0.1, 10]
may_hide = []
"""
SKIN = """
[[body.layer]]
name = "skin"
thickness = "2 mm"
young = "30 kPa"
poisson = 0.45
"""


def _curve(path, layer):
    """Write the curve of a field that is 1.3 times as stiff, on a mesh in three dimensions, with noise of 0.5 %."""
    body = CYLINDER | (
        {"layer": [{"name": "skin", "thickness": "2 mm", "young": "30 kPa", "poisson": 0.45}]} if layer else {}
    )
    mesh = {"fine": "2 mm", "rim": "0.1 mm", "growth": 0.4, "degree": 3}
    probe = {"contact": "frictionless", "depth": "0.2 mm"}
    (record,) = solve(
        body=body, material={"young": LUMP | {"scale": SCALE}, "poisson": 0.3}, mesh=mesh, probe=probe
    ).values()
    assert record.status == "ok", record.message
    depth = np.linspace(-0.1, 0.2, 200)
    force = record.force * np.maximum(depth, 0) / 0.2
    force += 0.005 * record.force * noise(np.random.default_rng(4), len(depth), 0.5)
    rows = "\n".join(f"{d:.6f},{1e3 * f:.6f}" for d, f in zip(depth, force, strict=True))
    path.write_text(f"depth (mm),force (mN)\n{rows}\n")


@pytest.mark.parametrize("layer", ["", pytest.param(SKIN, marks=pytest.mark.nightly)], ids=["alone", "below a skin"])
def test_the_scale_is_within_its_bar(tmp_path, epsmesh, layer):
    """Alone it is a factor of one case; below a skin, whose modulus is known, F is no multiple of it."""
    _curve(tmp_path / "punch.csv", layer)
    (tmp_path / "punch.toml").write_text(STUDY.format(layer=layer, formula=LUMP["formula"]))
    result = epsmesh("identify", tmp_path / "punch.toml", "--output", tmp_path)
    assert result.exit_code == 0, result.output
    assert "cale of the field of E = 1." in result.stdout
    dataset = xr.load_dataset(tmp_path / "punch.nc")
    scale = dataset.sel(unknown="scale")
    assert dataset.attrs["verdict"] == "fits"
    assert scale["low"] < SCALE < scale["high"]
    assert scale["high"] - scale["low"] < 0.2
    assert str(scale["unit"].values) == "1"


def _study(**sections):
    base = {
        "body": {"shape": "cylinder", "radius": "20 mm", "height": "10 mm", "fixed": "bottom"},
        "material": {"young": LUMP | {"scale": 2.0}, "poisson": 0.3},
        "probe": {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "contact": "frictionless"},
        "mesh": {"accuracy": "1 %"},
    }
    return parse({**base, **{name: base[name] | own for name, own in sections.items()}})


def test_a_scale_needs_one_case_and_is_an_exact_factor():
    asked = []
    solve = solved_by(lambda case: case.material.young * case.probe.depth, asked=asked)
    found = forward_of(_study(), [Unknown("scale", 0.1, 10.0, "1", is_logarithmic=True)], 1e-3, solve)
    assert len(asked) == 1
    one, three = (found.force(np.array([1e-3]), {"scale": scale}) for scale in (1.0, 3.0))
    assert three == pytest.approx(3 * one, rel=1e-12)
    young = _study().case(()).material.young / 2  # that of the study has a scale of 2
    assert one == pytest.approx(young * 1e-3, rel=1e-9)


def test_stiffness_that_is_not_scaled_is_not_a_factor():
    """Beside a known modulus F is interpolated over the scale; beside a capsule it is refused."""
    skin = {"name": "skin", "thickness": "2 mm", "young": "30 kPa", "poisson": 0.45}

    def force(case):
        (layer,) = case.body.layer
        return (layer.young + case.material.young) * case.probe.depth

    scene = _study(body={"layer": [skin]})
    unknown = Unknown("scale", 0.5, 2.0, "1", is_logarithmic=True)
    found = forward_of(scene, [unknown], 1e-3, solved_by(force))
    of_scale = scene.case(()).material.young / 2
    for scale in (0.6, 1.3):
        assert found.force(np.array([1e-3]), {"scale": scale}) == pytest.approx(
            (30e3 + scale * of_scale) * 1e-3, rel=1e-3
        )
    capsule = {"capsule": {"thickness": "0.1 mm", "young": "1 MPa", "poisson": 0.4}}
    with pytest.raises(StudyError, match="must be proportional to young"):
        forward_of(_study(body=capsule), [unknown], 1e-3, solved_by(force))


def test_a_scale_is_not_passed_on_as_a_modulus(tmp_path):
    dataset = identification(study=STUDY.format(layer="", formula="10 kPa"), names=("scale", "contact_point"))
    assert not is_passed_on(dataset)
    assert material(dataset).startswith('# in the table `young` of "material":\nscale = 1.3  # ± ')
    dataset.to_netcdf(tmp_path / "punch.nc")
    with pytest.raises(StudyError, match="scale cannot be passed on: write it into the table of the field"):
        parse(raw(material={"from": str(tmp_path / "punch.nc"), "young": None, "poisson": None}))
