"""Time integration of free particles, and the way of pinned ones."""

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import kernel
from garment_sim_ros.params import Material
from garment_sim_ros.sim.model import ClothModel, Parameters


def damping_rate(material: Material) -> float:
    """At which rate velocity dies away, by inner damping and by drag [1/s]."""
    return material.damping + material.air_drag / material.areal_density


def outer_forces(
    model: ClothModel, params: Parameters, dt: float, push: NDArray[np.float32]
) -> float:
    """What outer forces do in a step of dt [s], see `predict`.

    Args:
        model: The garment.
        params: Outer forces.
        dt: Step [s].
        push: Output, velocity gained [m/s], shape [3].

    Returns:
        Part of velocity that is kept.
    """
    drag = model.material.air_drag / model.material.areal_density
    keep = 1.0 / (1.0 + dt * damping_rate(model.material))
    for k in range(3):
        pull = params.environment.gravity[k] + drag * params.environment.wind[k]
        push[k] = keep * dt * pull
    return keep


@kernel()
def predict(x, v, x_start, x_predicted, push, keep, dt):
    """Outer forces and Verlet's step for free particles (Sun et al. 2007, equations 1 and 4).

    v' = keep v + push, x' = x + dt v'. All outer forces are proportional to mass, or to area and
    so to mass: gravity g, damping rate c, and viscous drag towards the wind u at the rate r =
    drag per area / mass per area. Damping and drag are taken at the end of the step, which is
    stable at any step: keep = 1 / (1 + dt (c + r)), push = keep dt (g + r u).

    Args:
        x: Positions, changed in place [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_start: Output, positions before the step [m], shape [n, 3].
        x_predicted: Output, positions after it [m], shape [n, 3].
        push: Velocity gained in the step [m/s], shape [3].
        keep: Part of velocity that is kept.
        dt: Step [s].
    """
    for i in range(v.shape[0]):
        for k in range(3):
            x_start[i, k] = x[i, k]
            v[i, k] = keep * v[i, k] + push[k]
            x[i, k] += dt * v[i, k]
            x_predicted[i, k] = x[i, k]


@kernel()
def update_velocities(
    x, v, x_start, x_predicted, contact_shape, contact_normal, carry, dt, motion
):
    """Velocities of free particles from the positions that constraints left.

    What constraints moved, divided by the step, is added to the velocity. A particle that was
    pushed out of a collider keeps the collider's normal velocity and no more (contact is fully
    inelastic): being pushed out of some depth gives no kick.

    Args:
        x: Positions at the end of the step [m], shape [n, 3].
        v: Velocities, changed in place [m/s], shape [n, 3].
        x_start: Positions at its start [m], shape [n, 3].
        x_predicted: Positions before constraints [m], shape [n, 3].
        contact_shape: Shape that each particle touches, -1 for none, shape [n].
        contact_normal: Outward normal there, shape [n, 3].
        carry: How points move with the shapes, see `PosedShapes`, shape [m, 3, 4].
        dt: Step [s].
        motion: Output, sum and maximum of squared speeds [m^2/s^2], shape [2].
    """
    rate = np.float32(1.0) / dt
    total = 0.0
    fastest = np.float32(0.0)
    for i in range(v.shape[0]):
        vx = v[i, 0] + (x[i, 0] - x_predicted[i, 0]) * rate
        vy = v[i, 1] + (x[i, 1] - x_predicted[i, 1]) * rate
        vz = v[i, 2] + (x[i, 2] - x_predicted[i, 2]) * rate
        c = contact_shape[i]
        if c >= 0:
            sx = x_start[i, 0]
            sy = x_start[i, 1]
            sz = x_start[i, 2]
            nx = contact_normal[i, 0]
            ny = contact_normal[i, 1]
            nz = contact_normal[i, 2]
            T = carry[c]
            leaving = (
                (vx - (T[0, 0] * sx + T[0, 1] * sy + T[0, 2] * sz + T[0, 3]) * rate) * nx
                + (vy - (T[1, 0] * sx + T[1, 1] * sy + T[1, 2] * sz + T[1, 3]) * rate) * ny
                + (vz - (T[2, 0] * sx + T[2, 1] * sy + T[2, 2] * sz + T[2, 3]) * rate) * nz
            )
            if leaving > np.float32(0.0):
                vx -= leaving * nx
                vy -= leaving * ny
                vz -= leaving * nz
        v[i, 0] = vx
        v[i, 1] = vy
        v[i, 2] = vz
        speed = vx * vx + vy * vy + vz * vz
        total += speed
        fastest = max(fastest, speed)
    motion[0] = total
    motion[1] = fastest


@kernel()
def measure_motion(v, motion):
    """Sum and maximum of squared speeds [m^2/s^2] of particles [n, 3], written to motion [2]."""
    total = 0.0
    fastest = np.float32(0.0)
    for p in range(v.shape[0]):
        speed = v[p, 0] * v[p, 0] + v[p, 1] * v[p, 1] + v[p, 2] * v[p, 2]
        total += speed
        fastest = max(fastest, speed)
    motion[0] = total
    motion[1] = fastest


@kernel(forceinline=True)
def move_pins(x, v, pin_collider, place, step, position, orientation, origin, dt):
    """Moves pinned particles rigidly with their colliders.

    Args:
        x: Positions of the pinned particles, changed in place [m], shape [p, 3].
        v: Their velocities, changed in place [m/s], shape [p, 3].
        pin_collider: Collider that each follows, shape [p].
        place: Its place in that collider's frame, changed in place [m], shape [p, 3].
        step: How far that moves in the step [m], shape [p, 3].
        position: World positions of all colliders [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
        dt: Step [s].
    """
    for p in range(pin_collider.size):
        c = pin_collider[p]
        q = orientation[c]
        for k in range(3):
            place[p, k] += step[p, k]
        turned = rotate(q[0], q[1], q[2], q[3], place[p, 0], place[p, 1], place[p, 2])
        for k in range(3):
            new = np.float32(turned[k] + position[c, k] - origin[k])
            v[p, k] = (new - x[p, k]) / dt
            x[p, k] = new


@kernel(inner=True)
def glide(x, v, time, x_coast):
    """Where particles get in some time [s] if nothing acts on them; arrays [n, 3]."""
    for p in range(x.shape[0]):
        for k in range(3):
            x_coast[p, k] = x[p, k] + time * v[p, k]


@kernel()
def shift(x, offset):
    """Adds `offset` [3] to all positions [n, 3]: a change of the local origin."""
    for i in range(x.shape[0]):
        for k in range(3):
            x[i, k] += offset[k]


@kernel()
def to_file_order(x, vertex, origin, x_world):
    """World positions of the mesh's vertices.

    Args:
        x: Particle positions relative to the local origin [m], shape [n, 3].
        vertex: The vertex that each particle is, shape [n].
        origin: World position of the local origin [m], shape [3].
        x_world: Output [m], shape [n, 3].
    """
    for i in range(x.shape[0]):
        for k in range(3):
            x_world[vertex[i], k] = x[i, k] + origin[k]
