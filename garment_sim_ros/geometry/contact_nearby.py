"""Which shapes come near which particles: rejection for a block at a time, then for each."""

import numpy as np

from garment_sim_ros.geometry.jit import kernel


@kernel()
def shapes_near_block(posed, x, begin, end, thickness, nearby):
    """Finds the shapes whose box comes near the box of particles begin to end - 1.

    Returns:
        Their number, written to the start of `nearby`; and how far a particle may be moved
        without meeting a shape that was left out [m].
    """
    x0 = x1 = x[begin, 0]
    y0 = y1 = x[begin, 1]
    z0 = z1 = x[begin, 2]
    for p in range(begin + 1, end):
        x0 = min(x0, x[p, 0])
        x1 = max(x1, x[p, 0])
        y0 = min(y0, x[p, 1])
        y1 = max(y1, x[p, 1])
        z0 = min(z0, x[p, 2])
        z1 = max(z1, x[p, 2])
    margin = np.float32(0.125) * max(x1 - x0, y1 - y0, z1 - z0)
    reach = thickness + margin
    box = posed.box
    found = 0
    for k in range(box.shape[0]):
        if (
            box[k, 0] - reach <= x1
            and box[k, 3] + reach >= x0
            and box[k, 1] - reach <= y1
            and box[k, 4] + reach >= y0
            and box[k, 2] - reach <= z1
            and box[k, 5] + reach >= z0
        ):
            nearby[found] = k
            found += 1
    return found, margin


@kernel()
def gap_to_bounds(bound, candidates, x, begin, end, thickness, gap):
    """Squared distance of particles to the nearest bounding axis, less the squared radius.

    Written to `gap`: negative where a candidate's bounding capsule, inflated by `thickness`, holds
    the particle. Without branches, so that it runs over several particles at once.
    """
    zero = np.float32(0.0)
    count = end - begin
    for p in range(count):
        gap[p] = np.float32(np.inf)
    for c in range(candidates.size):
        k = candidates[c]
        cx = bound[k, 0]
        cy = bound[k, 1]
        cz = bound[k, 2]
        ax = bound[k, 3]
        ay = bound[k, 4]
        az = bound[k, 5]
        length = bound[k, 6]
        radius = bound[k, 7] + thickness
        for p in range(count):
            qx = x[begin + p, 0] - cx
            qy = x[begin + p, 1] - cy
            qz = x[begin + p, 2] - cz
            t = qx * ax + qy * ay + qz * az
            t = zero if t < zero else (length if t > length else t)
            qx -= t * ax
            qy -= t * ay
            qz -= t * az
            g = qx * qx + qy * qy + qz * qz - radius * radius
            gap[p] = g if g < gap[p] else gap[p]


@kernel(forceinline=True)
def shapes_near_particle(bound, side, group, nearby, found, px, py, pz, reach):
    """Sorts the shapes near a block: those near a particle of it, by the side they are on.

    Near is where the bounding capsule is at most `reach` away.

    Returns:
        Numbers of shapes in rows 1 (under the cloth), 2 (passing) and 3 (opposed) of `nearby`.
    """
    under = 0
    passing = 0
    opposed = 0
    for c in range(found):
        k = nearby[0, c]
        qx = px - bound[k, 0]
        qy = py - bound[k, 1]
        qz = pz - bound[k, 2]
        t = qx * bound[k, 3] + qy * bound[k, 4] + qz * bound[k, 5]
        t = min(max(t, np.float32(0.0)), bound[k, 6])
        qx -= t * bound[k, 3]
        qy -= t * bound[k, 4]
        qz -= t * bound[k, 5]
        far = bound[k, 7] + reach
        if qx * qx + qy * qy + qz * qz > far * far:
            continue
        where = side[group, k]
        if where == 0:
            nearby[1, under] = k
            under += 1
        elif where == 1:
            nearby[2, passing] = k
            passing += 1
        else:
            nearby[3, opposed] = k
            opposed += 1
    return under, passing, opposed
