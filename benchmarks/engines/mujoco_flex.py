"""MuJoCo's flex: a grid of tetrahedra with Saint Venant-Kirchhoff's law, and a ball that is moved (mocap).

``python -m benchmarks.engines.mujoco_flex`` answers settings (:mod:`benchmarks.engines.scene`). The force is the sum of
`mj_contactForce` over all contacts.
"""

import mujoco
import numpy as np

from benchmarks.engines.scene import HEIGHT, POISSON, RADIUS, SIDE, WATER, YOUNG, Log, Outcome, Timed, place, serve

_SCENE = """
<mujoco>
  <option timestep="{tick}" gravity="0 0 0" integrator="{integrator}"/>
  <size memory="1G"/>
  <worldbody>
    <body name="pad"><flexcomp type="grid" count="{n} {n} {m}" spacing="{size} {size} {size}" pos="0 0 {middle}"
      radius="0" name="pad" dim="3" mass="{mass}">
      <contact condim="1" solref="{solref}" solimp="{solimp}" selfcollide="none"/>{edge}
      <elasticity young="{young}" poisson="{poisson}" damping="{damping}"/>
      <pin gridrange="0 0 0 {last} {last} 0"/>
    </flexcomp></body>
    <body name="ball" mocap="true" pos="0 0 1"><geom type="sphere" size="{radius}" condim="1"/></body>
  </worldbody>
</mujoco>"""


def simulate(
    size: float,
    tick: float = 1e-3,
    integrator: str = "discrete",
    solref: str = "0.01 1",
    solimp: str = ".95 .99 .0001",
    damping: float = 0.0,
    edge: float = 0.0,
    heavier: float = 1.0,
) -> Outcome:
    """Return what MuJoCo says with cubes of ``size``; ``heavier`` multiplies the pad's density, that of water.

    ``solref`` and ``solimp`` are MuJoCo's of the contact, ``damping`` and ``edge`` its dampings.
    """
    n, m = round(SIDE / size) + 1, round(HEIGHT / size) + 1
    text = _SCENE.format(
        tick=tick, integrator=integrator, n=n, m=m, last=n - 1, size=size, middle=-HEIGHT / 2, solref=solref,
        mass=heavier * WATER * SIDE * SIDE * HEIGHT, young=YOUNG, poisson=POISSON, solimp=solimp, damping=damping,
        radius=RADIUS, edge=f'<edge damping="{edge}"/>' if edge else "",
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    log, wrench = Log(tick, mujoco.__version__, model.nv), np.zeros(6)
    for t in log.times():
        x, depth = place(t)
        data.mocap_pos[0] = (x, 0, RADIUS - depth)
        with Timed(log):
            mujoco.mj_step(model, data)
        force, radius, sunk = np.zeros(3), 0.0, 0.0
        for number, contact in enumerate(data.contact[: data.ncon]):
            mujoco.mj_contactForce(model, data, number, wrench)
            if wrench[0] > 1e-9:
                # The normal leads from the contact's first object to its second one.
                sign = 1 if contact.geom[1] >= 0 else -1
                force += sign * wrench[0] * contact.frame[:3]
                radius = max(radius, float(np.hypot(contact.pos[0] - x, contact.pos[1])))
                sunk = max(sunk, -contact.dist)
        log.add(t, force, radius, sunk)
    return log.outcome()


if __name__ == "__main__":
    serve(simulate)
