"""What came of a run, worked out the same way for all simulators from positions of all frames."""

from types import SimpleNamespace

import numpy as np
import playing

from garment_sim_ros.contact.pierced import PiercedMeter
from garment_sim_ros.contact.shapes import Collider, ColliderPoses, ColliderSet
from garment_sim_ros.geometry.topology import mesh_topology

LAST = {"drape": 10, "hung": 120, "limb": 120}
"""Stretch is the median over so many frames at the end, of a frame's 95th percentile."""
_APART = 0.5
_OFF = 0.03
"""A pin that is so far from where it belongs has come off [m]."""
_FELL = -0.6
"""A sheet whose lowest point is below this is not on the sphere [m]."""


def _depth(scene: SimpleNamespace, n: int, x: np.ndarray) -> float:
    """How deep the deepest vertex or triangle centre is in the shape [m]; below 0: outside."""
    points = np.concatenate([x, x[scene.triangles].mean(axis=1)]) - scene.position[n]
    axis = playing.rotated(scene.orientation[n], np.array([[0.0, 0.0, 1.0]]))[0]
    along = np.clip(points @ axis, -0.5 * scene.length, 0.5 * scene.length)
    away = np.linalg.norm(points - along[:, None] * axis, axis=1)
    return scene.radius - float(away.min())


def _pierced(scene: SimpleNamespace, x: np.ndarray) -> float:
    """Share of the frames in which the limb's core runs through the cloth."""
    ends = {"radius0": scene.radius, "radius1": scene.radius, "length": scene.length}
    limb = Collider(name="limb", kind="capsule", bone="limb", geometry=ends)
    meter = PiercedMeter(ColliderSet(colliders=(limb,)))
    poses = ColliderPoses.identity(1)
    for n, positions in enumerate(x, start=1):
        q = scene.orientation[n]
        end = playing.rotated(q, np.array([[0.0, 0.0, -0.5 * scene.length]]))[0]
        poses.position[0], poses.orientation[0] = scene.position[n] + end, q
        meter.add(poses, {"tube": (positions, scene.triangles)})
    return meter.result().share


def judge(name: str, scene: SimpleNamespace, found: dict[str, np.ndarray]) -> dict[str, object]:
    """Figures of a run: lengths in mm, speeds in mm/s, stretch in percent, cost in F."""
    x = found["x"].astype(np.float64)
    if not np.isfinite(x).all():
        return {"fault": "not finite", "frames": len(x)}
    edges = mesh_topology(scene.triangles).edges
    rest = np.linalg.norm(scene.vertices[edges[:, 1]] - scene.vertices[edges[:, 0]], axis=1)
    stretch = np.array(
        [np.linalg.norm(f[edges[:, 1]] - f[edges[:, 0]], axis=1) / rest - 1.0 for f in x]
    )
    p95 = np.percentile(stretch, 95.0, axis=1)[-LAST[name] :]
    moved = np.sqrt((np.diff(x[-11:], axis=0) ** 2).sum(axis=2).mean(axis=1)) / scene.frame
    cost = found["time"] / found["unit"]
    deepest = max(_depth(scene, n, f) for n, f in enumerate(x, start=1))
    figures: dict[str, object] = {
        "cost_F": float(np.median(cost)),
        "cost_F_p10": float(np.percentile(cost, 10.0)),
        "cost_F_p90": float(np.percentile(cost, 90.0)),
        "F_ms": 1e3 * float(np.median(found["unit"])),
        "stretch_p95_percent": 100.0 * float(np.median(p95)),
        "stretch_max_percent": 100.0 * float(stretch[-LAST[name] :].max()),
        "penetration_mm": 1e3 * max(0.0, deepest),
        "speed_mm_s": 1e3 * float(moved.max()) if len(moved) else 0.0,
        "lowest_m": float(x[-1, :, 2].min()),
        "frames": len(x),
    }
    fault = ""
    if name == "limb":
        figures["pierced"] = _pierced(scene, x)
        fault = "pierced" if figures["pierced"] else ""
    if len(x) < scene.frames:
        fault = f"stopped: takes over {playing.MOST:.0f} s"
    if np.percentile(stretch[-1], 95.0) > _APART:
        fault = "comes apart"
    elif name == "drape" and figures["lowest_m"] < _FELL:  # type: ignore[operator]
        fault = "falls through"
    pins = playing.pinned(scene, len(x))
    if len(pins) and np.linalg.norm(x[-1, scene.pins] - pins, axis=1).max() > _OFF:
        fault = "pins come off"
    return {**figures, "fault": fault}
