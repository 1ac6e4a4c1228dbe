"""The studies whose cases a table of forces is made of."""

from epsmesh.study.read import read_mapping
from epsmesh_identify.surrogate.derived import derive

TISSUE = {"young": "20 kPa", "poisson": 0.45, "spread": {"young": "20 %", "correlation_length": "3 mm"}}


def test_layers_may_leave_nothing_for_a_material_and_lose_their_spread():
    layers = [{"name": name, "thickness": "4 mm"} | TISSUE for name in ("skin", "fat")]
    scene = read_mapping({
        "body": {"shape": "cylinder", "radius": "30 mm", "height": "8 mm", "layer": layers},
        "probe": {"shape": "disc", "radius": "3 mm", "depth": "0.1 mm"},
        "mesh": {"accuracy": "1 %"},
    }, "layers")  # fmt: skip
    derived = derive(scene, {}, 0.01)
    assert "material" not in derived.raw
    assert all("spread" not in layer for layer in derived.raw["body"]["layer"])
    assert all("spread" in layer for layer in scene.raw["body"]["layer"])
