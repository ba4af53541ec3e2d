"""Cholesky factors of a mesh's matrix, front by front, and solutions with them.

The matrix is the sum of a diagonal and of ``k_e (e_i - e_j) (e_i - e_j)^T`` over edges, without
their diagonal part. Of L, a front keeps for its columns ``[L11^-1; L21 L11^-1]``: a solution then
is products of dense blocks with vectors, without any division or recurrence, several times faster.
"""

import numpy as np

from garment_sim_ros.jit import lean_kernel
from garment_sim_ros.sim.solvers.implicit.dissection import PAD


@lean_kernel(inner=True)
def _add4(out, a, b, c, d, p, q, r, s):
    for j in range(out.size):
        out[j] += p * a[j] + q * b[j] + r * c[j] + s * d[j]


@lean_kernel(inner=True)
def _add(out, a, p):
    for j in range(out.size):
        out[j] += p * a[j]


@lean_kernel(inner=True)
def _dot4(a, b, c, d, x):
    p = q = r = s = np.float32(0.0)
    for j in range(x.size):
        p += a[j] * x[j]
        q += b[j] * x[j]
        r += c[j] * x[j]
        s += d[j] * x[j]
    return p, q, r, s


@lean_kernel(inner=True)
def _dot(a, x):
    p = np.float32(0.0)
    for j in range(x.size):
        p += a[j] * x[j]
    return p


@lean_kernel(inner=True)
def _scale(out, p):
    for j in range(out.size):
        out[j] *= p


@lean_kernel(inner=True)
def _gather(fronts, s, stiffness, diagonal, update, front):
    """Entries of a front [m m], upper triangle: its own and what its children add."""
    begin = fronts.first[s]
    width = fronts.first[s + 1] - begin
    m = width + fronts.row_start[s + 1] - fronts.row_start[s]
    front[: m * m] = 0.0
    for e in range(fronts.entry_start[s], fronts.entry_start[s + 1]):
        front[fronts.entry_local[e]] -= stiffness[fronts.entry_edge[e]]
    for i in range(width):
        front[i * m + i] += diagonal[begin + i]
    for t in range(fronts.child_start[s], fronts.child_start[s + 1]):
        to = fronts.local[fronts.local_start[t] : fronts.local_start[t + 1]]
        at = fronts.update_start[fronts.child[t]]
        n = to.size
        for i in range(n):
            row = front[to[i] * m : to[i] * m + m]
            part = update[at + i * n : at + i * n + n]
            for j in range(i, n):
                row[np.uint64(to[j])] += part[j]


@lean_kernel(inner=True)
def _eliminate(front, width, m):
    """The first rows of a front [m m] become those of L^T, the others what is left."""
    for p in range(0, width, 4):
        end = min(p + 4, width)
        for i in range(p, end):
            row = front[i * m + i : i * m + m]
            for k in range(p, i):
                _add(row, front[k * m + i : k * m + m], -front[k * m + i])
            _scale(row, 1.0 / np.sqrt(row[0]))
        if end == p + 4:
            a = front[p * m : p * m + m]
            b = front[p * m + m : p * m + 2 * m]
            c = front[p * m + 2 * m : p * m + 3 * m]
            d = front[p * m + 3 * m : p * m + 4 * m]
            for i in range(end, m):
                out = front[i * m + i : i * m + m]
                _add4(out, a[i:], b[i:], c[i:], d[i:], -a[i], -b[i], -c[i], -d[i])
        else:
            for k in range(p, end):
                a = front[k * m : k * m + m]
                for i in range(end, m):
                    _add(front[i * m + i : i * m + m], a[i:], -a[i])


@lean_kernel(inner=True)
def _invert(front, width, m, factor):
    """Columns of [L11^-1; L21 L11^-1], last one first, from T L11 = [1; L21]."""
    length = (m + PAD - 1) // PAD * PAD
    for k in range(width - 1, -1, -1):
        out = factor[k * length : (k + 1) * length]
        out[:] = np.float32(0.0)
        out[k] = np.float32(1.0)
        for j in range(width, m):
            out[j] = front[k * m + j]
        j = k + 1
        while j + 4 <= width:
            skip = j // PAD * PAD
            at = j * length
            _add4(
                out[skip:],
                factor[at + skip : at + length],
                factor[at + length + skip : at + 2 * length],
                factor[at + 2 * length + skip : at + 3 * length],
                factor[at + 3 * length + skip : at + 4 * length],
                -np.float32(front[k * m + j]),
                -np.float32(front[k * m + j + 1]),
                -np.float32(front[k * m + j + 2]),
                -np.float32(front[k * m + j + 3]),
            )
            j += 4
        while j < width:
            _add(out, factor[j * length : (j + 1) * length], -np.float32(front[k * m + j]))
            j += 1
        _scale(out, np.float32(1.0 / front[k * m + k]))


@lean_kernel(forceinline=True)
def factorise(fronts, stiffness, diagonal, changed, front, update, factor):
    """Factors the matrix again where it changed.

    Args:
        fronts: See `sim.solvers.implicit.dissection.Fronts`.
        stiffness: Of the edges, float64, shape [m].
        diagonal: In the order of elimination, float64, shape [n].
        changed: Fronts with a column whose entries changed; all False afterwards, shape [fronts].
        front: Scratch, float64, shape [widest^2].
        update: What fronts add to their parents, kept from call to call, float64.
        factor: Output, float32.
    """
    for s in range(changed.size):
        if not changed[s]:
            continue
        changed[s] = False
        if fronts.parent[s] >= 0:
            changed[fronts.parent[s]] = True
        width = fronts.first[s + 1] - fronts.first[s]
        n = fronts.row_start[s + 1] - fronts.row_start[s]
        m = width + n
        _gather(fronts, s, stiffness, diagonal, update, front)
        _eliminate(front, width, m)
        at = fronts.update_start[s]
        for i in range(n):
            left = update[at + i * n : at + i * n + n]
            row = front[(width + i) * m + width : (width + i) * m + m]
            for j in range(i, n):
                left[j] = row[j]
        _invert(front, width, m, factor[fronts.factor_start[s] : fronts.factor_start[s + 1]])


@lean_kernel(forceinline=True)
def solve_factorised(fronts, factor, x, scratch):
    """Solves for three right-hand sides at once.

    Args:
        fronts: See `sim.solvers.implicit.dissection.Fronts`.
        factor: From `factorise`.
        x: Right-hand sides, solutions afterwards, in the order of elimination, shape [3, n] or
            longer rows.
        scratch: Shape [widest].
    """
    count = fronts.parent.size
    for s in range(count):
        begin = fronts.first[s]
        width = fronts.first[s + 1] - begin
        to = fronts.rows[fronts.row_start[s] : fronts.row_start[s + 1]]
        m = (width + to.size + PAD - 1) // PAD * PAD
        f = factor[fronts.factor_start[s] : fronts.factor_start[s + 1]]
        fours = width - width % 4
        for d in range(3):
            row = x[d]
            own = row[begin : begin + width]
            t = scratch[:m]
            t[:] = np.float32(0.0)
            for k in range(0, fours, 4):
                skip = k // PAD * PAD
                at = k * m
                _add4(
                    t[skip:],
                    f[at + skip : at + m],
                    f[at + m + skip : at + 2 * m],
                    f[at + 2 * m + skip : at + 3 * m],
                    f[at + 3 * m + skip : at + 4 * m],
                    own[k],
                    own[k + 1],
                    own[k + 2],
                    own[k + 3],
                )
            for k in range(fours, width):
                _add(t, f[k * m : k * m + m], own[k])
            for j in range(width):
                own[j] = t[j]
            below = t[width:]
            for j in range(to.size):
                row[np.uint64(to[j])] -= below[j]
    for s in range(count - 1, -1, -1):
        begin = fronts.first[s]
        width = fronts.first[s + 1] - begin
        to = fronts.rows[fronts.row_start[s] : fronts.row_start[s + 1]]
        m = (width + to.size + PAD - 1) // PAD * PAD
        f = factor[fronts.factor_start[s] : fronts.factor_start[s + 1]]
        fours = width - width % 4
        for d in range(3):
            row = x[d]
            own = row[begin : begin + width]
            t = scratch[:m]
            t[width:] = np.float32(0.0)
            for j in range(width):
                t[j] = own[j]
            below = t[width:]
            for j in range(to.size):
                below[j] = -row[np.uint64(to[j])]
            for k in range(0, fours, 4):
                at = k * m
                own[k], own[k + 1], own[k + 2], own[k + 3] = _dot4(
                    f[at : at + m],
                    f[at + m : at + 2 * m],
                    f[at + 2 * m : at + 3 * m],
                    f[at + 3 * m : at + 4 * m],
                    t,
                )
            for k in range(fours, width):
                own[k] = _dot(f[k * m : k * m + m], t)
