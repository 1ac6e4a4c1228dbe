"""Make the force curves of studies/identify-*.toml: python scripts/make_curves.py [FOLDER]

Round frictionless tools on layers that are endless sidewards, by the integral equation of
`epsmesh_identify.layered`, with what a testing machine adds: a contact point anywhere, air before it, a baseline, a
load frame that yields, correlated noise. The same files every time. What they were made with is in TRUTH, for the tests
and the documentation.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from epsmesh_identify.layered.body import RIGID, LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile

CURVES = Path(__file__).resolve().parents[1] / "studies" / "curves"

# What is to be found, in SI units.
TRUTH: dict[str, dict[str, float]] = {
    "identify-punch": {"young": 25e3},
    "identify-two-punches": {"young": 8e3, "poisson": 0.46},
    "identify-layers": {"skin_young": 120e3, "fat_young": 12e3},
    "identify-relaxation": {"young": 15e3, "relaxation_share_1": 0.35, "relaxation_time_1": 6.0},
}


@dataclass(frozen=True)
class Machine:
    """How a curve is recorded: the recorded depth of the contact point (m), baseline (N), stiffness (N/m), and noise.

    ``noise`` is the standard deviation as a share of the largest force, ``correlation`` that of neighbouring points.
    """

    contact: float
    baseline: float
    stiffness: float = np.inf
    noise: float = 0.004
    correlation: float = 0.8
    count: int = 400


def ball(radius: float) -> Profile:
    """Return the section of a ball."""
    return Profile(lambda distance: distance / np.sqrt(radius**2 - distance**2), limit=0.999 * radius)


def disc(radius: float) -> Profile:
    """Return the section of a flat punch."""
    return Profile(lambda distance: 0 * distance, limit=radius, flat=radius)


def body(*layers: tuple[float, float, float]) -> LayeredBody:
    """Return layers of Young's modulus (Pa), Poisson's ratio and thickness (m) on a rigid base, from the top."""
    return LayeredBody(tuple(Layer(*layer) for layer in layers), RIGID)


def noise(force: np.ndarray, machine: Machine, seed: int) -> np.ndarray:
    """Return a first-order autoregressive process, smaller in air."""
    white = np.random.default_rng(seed).normal(size=len(force) + 200)
    rho = machine.correlation
    process = np.sqrt(1 - rho**2) * lfilter([1.0], [1.0, -rho], white)[200:]
    size = machine.noise * force.max()
    return np.asarray(size * (0.3 + 0.7 * np.clip(force / force.max(), 0, 1)) * process)


def pressed(tissue: LayeredBody, tool: Profile, deepest: float, machine: Machine, seed: int) -> np.ndarray:
    """Return recorded depth (m) and force (N) of a press to a depth (m), with air before it: (n, 2)."""
    depth = np.linspace(-0.3 * deepest, deepest, machine.count)
    force = np.asarray(tissue.table(tool, deepest)(depth) * tissue.top.plane)
    recorded = machine.contact + depth + force / machine.stiffness
    return np.column_stack([recorded, machine.baseline + force + noise(force, machine, seed)])


def held(
    tissue: LayeredBody, tool: Profile, deepest: float, terms: list[tuple[float, float]], machine: Machine, seed: int
) -> np.ndarray:
    """Return time (s), recorded depth (m) and force (N) of a ramp of a second and a hold: (n, 3).

    F(t) = ∫ G(t - s) dF_e(s), by sums over steps of a hundredth of those that are recorded.
    """
    fine = np.linspace(-0.3, 30.0, 30301)
    depth = np.clip(fine, None, 1.0) * deepest
    elastic = np.asarray(tissue.table(tool, deepest)(depth) * tissue.top.plane)
    force = (1 - sum(share for share, _ in terms)) * elastic
    for share, time in terms:
        kept = np.exp(-(fine[1] - fine[0]) / time)
        rises = np.concatenate([[0.0], np.diff(elastic)])
        force = force + share * lfilter([np.sqrt(kept)], [1.0, -kept], rises)
    times = np.concatenate([np.arange(-0.3, 1.2, 0.01), np.arange(1.2, 30.0, 0.1)])
    depth, force = (np.interp(times, fine, values) for values in (depth, force))
    return np.column_stack(
        [times + 0.3, machine.contact + depth, machine.baseline + force + noise(force, machine, seed)]
    )


def write(path: Path, heads: tuple[str, ...], columns: np.ndarray, factors: tuple[float, ...]) -> None:
    """Write columns in the units of their heads."""
    rows = [",".join(f"{value:.6g}" for value in row) for row in columns * np.array(factors)]
    path.write_text("\n".join([",".join(heads), *rows]) + "\n", encoding="utf-8")


# A study of the curves that `write_punch` makes, in `file`.
PUNCH = """title = "Punch"
[body]
shape = "cylinder"
radius = "40 mm"
height = "10 mm"
fixed = "bottom"
[material]
poisson = 0.4
[probe]
shape = "disc"
radius = "2 mm"
contact = "frictionless"
[[measurement]]
name = "punch"
file = "{file}"
[identify]
young = ["1 kPa", "1 MPa"]
may_hide = {may_hide}
"""


def write_punch(path: Path, young: float, seed: int) -> None:
    """Write the curve of a flat punch of 2 mm on a wide layer of 10 mm, of ``young`` (Pa)."""
    found = pressed(body((young, 0.4, 10e-3)), disc(2e-3), 0.2e-3, Machine(0.5e-3, 1e-3, count=150), seed)
    write(path, ("depth (mm)", "force (mN)"), found, (1e3, 1e3))


def main(folder: Path) -> None:
    """Write all curves into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    heads, factors = ("depth (mm)", "force (mN)"), (1e3, 1e3)
    found = TRUTH["identify-punch"]
    gel = body((found["young"], 0.49, 20e-3))
    made = {"ball": pressed(gel, ball(3e-3), 0.6e-3, Machine(1.234e-3, -2e-3), 1)}
    found = TRUTH["identify-two-punches"]
    pad = body((found["young"], found["poisson"], 4e-3))
    made["punch-narrow"] = pressed(pad, disc(0.5e-3), 0.1e-3, Machine(0.311e-3, 1e-4, noise=0.003), 2)
    made["punch-wide"] = pressed(pad, disc(4e-3), 0.2e-3, Machine(0.157e-3, -1e-3, noise=0.003), 3)
    found = TRUTH["identify-layers"]
    skin = body((found["skin_young"], 0.48, 1.5e-3), (found["fat_young"], 0.48, 15e-3))
    made["skin-small"] = pressed(skin, ball(1e-3), 0.2e-3, Machine(0.8e-3, 1e-3, 60e3), 4)
    made["skin-large"] = pressed(skin, ball(6e-3), 1e-3, Machine(0.5e-3, -5e-4, 60e3), 5)
    for name, columns in made.items():
        write(folder / f"{name}.csv", heads, columns, factors)
    found = TRUTH["identify-relaxation"]
    terms = [(found["relaxation_share_1"], found["relaxation_time_1"])]
    liver = body((found["young"], 0.47, 20e-3))
    columns = held(liver, ball(4e-3), 1e-3, terms, Machine(0.4e-3, 3e-4), 6)
    write(folder / "ramp-hold.csv", ("time (s)", *heads), columns, (1.0, *factors))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else CURVES)
