"""Soft attachments within an `implicit` sub-step: springs in the energy and in the matrix."""

import numpy as np

from garment_sim_ros.geometry.transforms import rotate
from garment_sim_ros.jit import kernel


@kernel()
def begin_ties(x, x_start, behind, ties, position, orientation, origin):
    """The way from each attached particle to where its spring and its damper pull it.

    A spring k and a damper c, of step h, whose place moves by u, pull a particle by
    ``k (place - x) + c / h (u - (x - x_start))``: a spring k + c / h whose end is in between.
    A particle whose spring is firm goes to its place at once, and stays.

    Args:
        x: Predicted positions, changed where springs are firm [m], shape [n, 3].
        x_start: Positions at the start of the sub-step [m], shape [n, 3].
        behind: See `predict_with_share`; follows x, shape [n, 3].
        ties: `solvers.implicit.given.Ties`.
        position: World positions of all colliders at the end of the sub-step [m], shape [c, 3].
        orientation: Their unit quaternions, shape [c, 4].
        origin: World position of the local origin [m], shape [3].
    """
    for s in range(ties.particle.size):
        p = ties.particle[s]
        q = orientation[ties.collider[s]]
        at = ties.spot[s]
        turned = rotate(q[0], q[1], q[2], q[3], at[0], at[1], at[2])
        known = ties.target[s, 0] == ties.target[s, 0]
        for k in range(3):
            goal = turned[k] + position[ties.collider[s], k] - origin[k]
            way = goal - x[p, k]
            if ties.firm[s]:
                x[p, k] += way
                behind[p, k] -= way
                way = 0.0
            else:
                slip = x_start[p, k] - x[p, k] + goal - ties.target[s, k] if known else 0.0
                way = ties.spring[s] * way + (1.0 - ties.spring[s]) * slip
            ties.lead[s, k] = way
            ties.target[s, k] = goal


@kernel(inner=True)
def add_ties(place, ties, force):
    """Adds the pull of attachments to forces [3, free + 1]; what is firm does not feel any."""
    for s in range(ties.particle.size):
        q = place[ties.particle[s]]
        for k in range(3):
            if ties.firm[s]:
                force[k, q] = np.float32(0.0)
            else:
                force[k, q] += ties.pull[s] * ties.lead[s, k]


@kernel(inner=True)
def follow_ties(place, ties, change, step):
    """What is left to pull after `move`."""
    for s in range(ties.particle.size):
        q = place[ties.particle[s]]
        for k in range(3):
            ties.lead[s, k] -= step * change[k, q]
