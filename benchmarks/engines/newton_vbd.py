"""Newton's vertex block descent (VBD): neo-Hookean tetrahedra, and a ball that is moved as a kinematic body.

``python -m benchmarks.engines.newton_vbd`` answers settings (:mod:`benchmarks.engines.scene`). The force is the sum of
the solver's observable ``contact_f`` over all contacts with the ball, on the CPU.
"""

from typing import Any

import newton
import numpy as np
import warp as wp

from benchmarks.engines.scene import HEIGHT, RADIUS, SIDE, WATER, Log, Outcome, Timed, lame, place, serve

_READ = 5e-3  # s between readings of forces
_PARTICLE = 1e-5  # m: radius of a particle, a part of the distance at which it touches


def simulate(
    size: float,
    tick: float = 1 / 600,
    iterations: int = 10,
    stiffness: float = 1e2,
    damping: float = 10.0,
    heavier: float = 1.0,
    full: bool = False,
) -> Outcome:
    """Return what Newton says with cubes of ``size``: ``stiffness`` (N/m) is a contact's of a particle.

    ``damping`` (Pa s) is the tissue's; ``heavier`` multiplies the pad's density, that of water.
    ``full`` adds contacts of edges and faces to those of particles.
    """
    counts, (mu, lam) = [round(length / size) for length in (SIDE, SIDE, HEIGHT)], lame()
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    builder.add_soft_grid(
        pos=wp.vec3(-SIDE / 2, -SIDE / 2, -HEIGHT), rot=wp.quat_identity(), vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=counts[0], dim_y=counts[1], dim_z=counts[2], cell_x=size, cell_y=size, cell_z=size,
        density=heavier * WATER, k_mu=mu, k_lambda=lam, k_damp=damping, particle_radius=_PARTICLE,
    )  # fmt: skip
    at_first = np.array([tuple(point) for point in builder.particle_q])
    ball = builder.add_body(xform=wp.transform(wp.vec3(0.0, 0.0, 2 * RADIUS), wp.quat_identity()), is_kinematic=True)
    smooth = newton.ModelBuilder.ShapeConfig(ke=stiffness, kd=0.0, mu=0.0, margin=0.0)
    builder.add_shape_sphere(ball, radius=RADIUS, cfg=smooth)
    builder.color()
    model = builder.finalize(device="cpu")
    flags = model.particle_flags.numpy()
    flags[at_first[:, 2] < -HEIGHT + size / 2] &= ~int(newton.ParticleFlags.ACTIVE)
    model.particle_flags = wp.array(flags, dtype=wp.int32)
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = stiffness, 0.0, 0.0
    pipeline = newton.CollisionPipeline(model, soft_contact_gap=1e-3, enable_rigid_soft_full_surface_contact=full)
    solver = newton.solvers.SolverVBD(
        model,
        iterations=iterations,
        particle_enable_tile_solve=False,
        integrate_with_external_rigid_solver=True,
        rigid_body_particle_contact_buffer_size=2048,
    )
    now, then, control, contacts = model.state(), model.state(), model.control(), pipeline.contacts()
    observed = solver.observables(["contact_f"], contacts=contacts)
    log, before = Log(tick, newton.__version__, 3 * len(at_first)), now.body_q.numpy()
    every, still = max(1, round(_READ / tick)), np.zeros((1, 6), np.float32)
    for number, t in enumerate(log.times()):
        x, depth = place(t)
        after = before.copy()
        after[0, :3] = x, 0, RADIUS - depth
        now.body_q.assign(after)
        now.body_qd.assign(still)
        then.body_q.assign(after)
        then.body_qd.assign(still)
        with Timed(log):
            now.clear_forces()
            pipeline.collide(now, contacts)
            solver.step(now, then, control, contacts, tick, observables=observed)
        if number == 0:
            log.spent = 0.0  # kernels are compiled in the first step
        now, then, before = then, now, after
        if number % every == 0:
            log.add(t, *_read(contacts, observed, now, x))
    return log.outcome()


def _read(contacts: Any, observed: Any, state: Any, x: float) -> tuple[np.ndarray, float, float]:
    """Return the force on the ball, the contact's radius, and how far a particle is within the ball."""
    count, first = int(contacts.soft_contact_count.numpy()[0]), contacts.rigid_contact_max
    forces = observed.contact_f.numpy()[first : first + count, :3]
    corners = contacts.soft_contact_indices.numpy()[:count]  # of an edge or a face, -1 beyond
    shares = np.where(corners >= 0, contacts.soft_contact_barycentric.numpy()[:count], 0.0)
    shares[corners[:, 1] < 0, 0] = 1.0
    points = np.einsum("ij,ijk->ik", shares, state.particle_q.numpy()[corners])
    pressed = np.linalg.norm(forces, axis=1) > 1e-9
    if not pressed.any():
        return np.zeros(3), 0.0, 0.0
    away = points[pressed] - [x, 0, state.body_q.numpy()[0, 2]]
    sunk = float((RADIUS - np.linalg.norm(away, axis=1)).max())
    return forces.sum(axis=0), float(np.hypot(away[:, 0], away[:, 1]).max()), sunk


if __name__ == "__main__":
    serve(simulate)
