"""What triangles of a moving mesh, and connected patches of them, sweep in some time to come."""

import numpy as np

from garment_sim_ros.jit import lean_kernel

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@lean_kernel(inner=True)
def difference(a, i, j):
    """Squared distance of two rows."""
    dx = a[i, 0] - a[j, 0]
    dy = a[i, 1] - a[j, 1]
    dz = a[i, 2] - a[j, 2]
    return dx * dx + dy * dy + dz * dz


@lean_kernel(inner=True)
def dot(a, i, j):
    """Dot product of two rows."""
    return a[i, 0] * a[j, 0] + a[i, 1] * a[j, 1] + a[i, 2] * a[j, 2]


@lean_kernel(inner=True)
def sweep(start, way, triangles, slack, swept):
    """Boxes of triangles that go their ways, larger by slack; unit normals and centres.

    Also how far corners are from the centre, their mean way, and how far theirs are from that.

    Args:
        start: Positions [m], shape [n, 3].
        way: Where each particle goes from there [m], shape [n, 3].
        triangles: Triangles as particles, shape [t, 3].
        slack: How much larger boxes are on each side [m].
        swept: `sim.self_collision.patches.Swept`, filled.
    """
    boxes, normal, centre, mean_way = swept.boxes, swept.normal, swept.centre, swept.mean_way
    third = np.float32(1.0 / 3.0)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ex, ey, ez = (
            start[j, 0] - start[i, 0],
            start[j, 1] - start[i, 1],
            start[j, 2] - start[i, 2],
        )
        fx, fy, fz = (
            start[k, 0] - start[i, 0],
            start[k, 1] - start[i, 1],
            start[k, 2] - start[i, 2],
        )
        ax, ay, az = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
        scale = _ONE / max(np.sqrt(ax * ax + ay * ay + az * az), np.float32(1e-12))
        normal[t, 0] = scale * ax
        normal[t, 1] = scale * ay
        normal[t, 2] = scale * az
        for d in range(3):
            a, b, c = start[i, d], start[j, d], start[k, d]
            a1, b1, c1 = a + way[i, d], b + way[j, d], c + way[k, d]
            boxes[t, d] = min(min(min(a, b), c), min(min(a1, b1), c1)) - slack
            boxes[t, 3 + d] = max(max(max(a, b), c), max(max(a1, b1), c1)) + slack
            centre[t, d] = third * (a + b + c)
            mean_way[t, d] = third * (way[i, d] + way[j, d] + way[k, d])
        farthest = differs = _ZERO
        for c in range(3):
            p = triangles[t, c]
            away = strays = _ZERO
            for d in range(3):
                away += (start[p, d] - centre[t, d]) ** 2
                strays += (way[p, d] - mean_way[t, d]) ** 2
            farthest = max(farthest, away)
            differs = max(differs, strays)
        swept.radius[t] = np.sqrt(farthest)
        swept.sway[t] = np.sqrt(differs)


@lean_kernel(inner=True)
def sweep_patches(first, swept):
    """The same of patches of triangles, which begin at first [p + 1]; the last box is that of all.

    Their normals are within the angle spread [rad] of axis.
    """
    boxes, normal, centre, mean_way = swept.boxes, swept.normal, swept.centre, swept.mean_way
    patch_boxes, axis, spread = swept.patch_boxes, swept.axis, swept.spread
    patch_centre, patch_way, flutter = swept.patch_centre, swept.patch_way, swept.flutter
    patches = first.size - 1
    patch_boxes[:, :3] = np.float32(np.inf)
    patch_boxes[:, 3:] = np.float32(-np.inf)
    for p in range(patches):
        for d in range(3):
            total = _ZERO
            middle = _ZERO
            way = _ZERO
            for t in range(first[p], first[p + 1]):
                patch_boxes[p, d] = min(patch_boxes[p, d], boxes[t, d])
                patch_boxes[p, 3 + d] = max(patch_boxes[p, 3 + d], boxes[t, 3 + d])
                total += normal[t, d]
                middle += centre[t, d]
                way += mean_way[t, d]
            axis[p, d] = total
            patch_centre[p, d] = middle / np.float32(first[p + 1] - first[p])
            patch_way[p, d] = way / np.float32(first[p + 1] - first[p])
            patch_boxes[patches, d] = min(patch_boxes[patches, d], patch_boxes[p, d])
            patch_boxes[patches, 3 + d] = max(patch_boxes[patches, 3 + d], patch_boxes[p, 3 + d])
        scale = _ONE / max(np.sqrt(dot(axis, p, p)), np.float32(1e-12))
        least = _ONE
        for d in range(3):
            axis[p, d] *= scale
        for t in range(first[p], first[p + 1]):
            along = _ZERO
            for d in range(3):
                along += axis[p, d] * normal[t, d]
            least = min(least, along)
        flutter[p] = _ZERO
        for t in range(first[p], first[p + 1]):
            differs = _ZERO
            for d in range(3):
                differs += (mean_way[t, d] - patch_way[p, d]) ** 2
            flutter[p] = max(flutter[p], np.sqrt(differs) + swept.sway[t])
        spread[p] = np.arccos(max(least, -_ONE))


@lean_kernel(inner=True)
def _cell_range(box, low, scale, d):
    """First cell along an axis that a box covers, and the one after the last."""
    return int((box[d] - low[d]) * scale), int((box[3 + d] - low[d]) * scale) + 1


@lean_kernel(inner=True)
def sort_into_cells(boxes, cell_start, entry):
    """Counting sort of boxes, the last of which is that of all, by the cells that they cover.

    Returns:
        Cells in a metre, and their numbers along y and z; the entries of cell c are from
        cell_start[c] to cell_start[c + 1].
    """
    count = boxes.shape[0] - 1
    low = boxes[count]
    cells = cell_start.size - 2
    size = 0.0
    for p in range(count):
        for d in range(3):
            size += boxes[p, 3 + d] - boxes[p, d]
    # Cells of about the size of a box; larger ones until there is room for all.
    cell = np.float32(max(size / (3 * count), 1e-6))
    while True:
        scale = _ONE / cell
        room = 1.0
        for d in range(3):
            room *= np.floor((low[3 + d] - low[d]) * scale) + 1.0
        if room <= cells:
            ny = int((low[4] - low[1]) * scale) + 1
            nz = int((low[5] - low[2]) * scale) + 1
            cell_start[:] = 0
            total = 0
            for p in range(count):
                x0, x1 = _cell_range(boxes[p], low, scale, 0)
                y0, y1 = _cell_range(boxes[p], low, scale, 1)
                z0, z1 = _cell_range(boxes[p], low, scale, 2)
                for ix in range(x0, x1):
                    for iy in range(y0, y1):
                        for iz in range(z0, z1):
                            cell_start[(ix * ny + iy) * nz + iz + 2] += 1
                total += (x1 - x0) * (y1 - y0) * (z1 - z0)
            if total <= entry.size:
                break
        cell *= np.float32(1.5)
    for c in range(cells):
        cell_start[c + 2] += cell_start[c + 1]
    for p in range(count):
        x0, x1 = _cell_range(boxes[p], low, scale, 0)
        y0, y1 = _cell_range(boxes[p], low, scale, 1)
        z0, z1 = _cell_range(boxes[p], low, scale, 2)
        for ix in range(x0, x1):
            for iy in range(y0, y1):
                for iz in range(z0, z1):
                    c = (ix * ny + iy) * nz + iz
                    entry[cell_start[c + 1]] = p
                    cell_start[c + 1] += 1
    return scale, ny, nz
