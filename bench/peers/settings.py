"""Which simulators are compared, with what each is asked to do: data alone.

Settings of a peer are those that its documentation and examples have for cloth, from cheap to
accurate, so that cost at equal error can be read off.
"""

from collections.abc import Mapping
from typing import Any

PACKAGES = {
    "pypbd": "pypbd==2.2.2",
    "pybullet": "pybullet==3.2.7",
    "mujoco": "mujoco==4.0.0",
    "newton": "newton==1.8.0",
}
"""What is installed, each into an environment of its own, with numpy."""


def _ours() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {
        f"xpbd, {n} sub-steps": {"solver": "xpbd", "sub_steps": n, "search_every": 10}
        for n in (8, 10, 15, 20, 30, 60)
    }
    found["xpbd, coarse, 18 sub-steps"] = {**found["xpbd, 8 sub-steps"], "sub_steps": 18}
    found["xpbd, coarse, 18 sub-steps"]["coarse"] = True
    for sub_steps, iterations in ((1, 4), (1, 8), (2, 4), (4, 4)):
        found[f"implicit, {sub_steps} x {iterations}"] = {
            **{"solver": "implicit", "sub_steps": sub_steps, "iterations": iterations},
        }
    return found


def _pypbd() -> dict[str, dict[str, Any]]:
    """Bending takes two thirds of its time and changes little here: all but one leave it out."""
    found: dict[str, dict[str, Any]] = {
        f"{name}, {n} x {k}": {"kind": kind, "sub_steps": n, "iterations": k}
        for name, kind in (("PBD", 1), ("XPBD", 4))
        for n, k in ((8, 1), (15, 1), (30, 1), (60, 1))
    }
    found["XPBD, 15 x 1, with bending"] = {**found["XPBD, 15 x 1"], "bending": True}
    return found


SETTINGS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "ours": _ours(),
    "pypbd": _pypbd(),
    "pybullet": {
        **{f"soft bodies, {n} steps": {"world": "soft", "steps": n} for n in (2, 4, 8, 16)},
        "deformables, 120 steps": {"world": "deformable", "steps": 120},
    },
    "mujoco": {
        **{
            f"elasticity, {name}, {n} x {k}": {
                **{"model": "elasticity", "solver": name, "steps": n, "iterations": k},
            }
            for name, n, k in (("CG", 1, 20), ("CG", 1, 50), ("CG", 2, 20), ("Newton", 1, 3))
        },
        "edges, CG, 4 x 20": {"model": "edges", "solver": "CG", "steps": 4, "iterations": 20},
    },
    "newton": {
        "XPBD, 10 x 1, a 1,000th of the stiffness": {
            **{"solver": "xpbd", "steps": 10, "iterations": 1, "share": 0.001},
        },
        "VBD, 5 x 5": {"solver": "vbd", "steps": 5, "iterations": 5},
        "Style3D, 1 x 10": {"solver": "style3d", "steps": 1, "iterations": 10},
        "Style3D, 2 x 10": {"solver": "style3d", "steps": 2, "iterations": 10},
    },
}
"""By simulator and name, what its script is called with. `n x k`: steps of a frame, iterations."""
