"""What a hull fit tells about each of its shapes."""

from typing import Any

import numpy as np

from garment_sim_ros.colliders.hulls.hulls import HullFit
from garment_sim_ros.contact.kinds.hull import HULL
from garment_sim_ros.contact.kinds.packed_hulls import LISTED, WHOLE, pack_hulls


def hull_report(fit: HullFit) -> dict[str, dict[str, Any]]:
    """Figures of each shape by name.

    Returns:
        ``kind``, ``note``, and for hulls ``faces_before`` and ``faces``, ``volume_excess`` over
        the un-inflated hull, ``clearance_mm_min`` and ``_mean`` that its faces have gained,
        ``outside`` (skin points of its region; 0), and of the map that contact uses ``cells`` and
        the ``longest`` and ``mean`` list of those that list faces, in fours.
    """
    report: dict[str, dict[str, Any]] = {}
    for shape, collider in zip(fit.shapes, fit.colliders.colliders):
        report[shape.name] = {"kind": shape.kind, "note": shape.note}
        if shape.kind != HULL.name:
            continue
        g = collider.geometry
        packed = pack_hulls({shape.name: (g["vertices"], g["faces"])})
        lists = packed.near.reshape(-1, LISTED)[:-1, -1].astype(np.int64)
        used = np.where(lists == WHOLE, packed.first[1], lists)[lists > 0]
        report[shape.name] |= {
            "faces_before": shape.faces_before,
            "faces": shape.faces,
            "volume_excess": round(shape.volume / max(shape.volume_before, 1e-12) - 1.0, 4),
            "clearance_mm_min": round(1e3 * shape.clearance_min, 3),
            "clearance_mm_mean": round(1e3 * shape.clearance_mean, 3),
            "outside": shape.outside,
            "map": {
                "cells": len(lists),
                "longest": int(used.max()),
                "mean": round(float(used.mean()), 2),
            },
        }
    return report
