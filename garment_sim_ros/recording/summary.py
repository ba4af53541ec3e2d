"""The figures of one recorded run, as they go into `summary.json`."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from garment_sim_ros.body.skin import Body
from garment_sim_ros.contact.pierced import Pierced, PiercedMeter
from garment_sim_ros.garment.garment import Garment
from garment_sim_ros.lateness import late_of
from garment_sim_ros.recording.bags import Recording
from garment_sim_ros.recording.metrics import ClothMeter, GarmentMesh, rate
from garment_sim_ros.recording.own_sides import OwnSides
from garment_sim_ros.recording.previews import Figure
from garment_sim_ros.recording.replay import Replay
from garment_sim_ros.recording.tracks import GarmentTrack


def figures(recording: Recording, body: Body) -> list[Figure]:
    """Skin and garments at the times `recording.stamp`."""
    replay = Replay(recording, body)
    tracks = recording.garments.values()
    return [
        replay.figure(int(stamp), tuple(t.positions[k].astype(float) for t in tracks))
        for k, stamp in enumerate(recording.stamp)
    ]


def summarize(
    recording: Recording,
    body: Body,
    garments: Iterable[Garment],
    shown: Iterable[Figure],
    *,
    frame_rate: float,
) -> dict[str, Any]:
    """Figures of a run.

    Args:
        recording: What was recorded.
        body: The avatar.
        garments: As the outfit makes them on this body, over the colliders of the run.
        shown: What `figures` gives; may be wrapped to show progress.
        frame_rate: At which frames are due [Hz].

    Returns:
        What goes into ``summary.json``; `late_frames` as the node counted them, None where it
        told none.
    """
    garments = tuple(garments)
    made = {g.name: g for g in garments}
    meshes = {name: _mesh(track, made.get(name)) for name, track in recording.garments.items()}
    own = OwnSides.of(garments, body) if {g.name for g in garments} >= meshes.keys() else None
    meter = ClothMeter(body.skin.vertices, body.skin.triangles, meshes, own)
    measured = 0
    for figure in shown:
        meter.add(figure.skin, dict(zip(meshes, figure.garments)))
        measured += 1
    times = [1e-9 * np.sort(t.arrival) for t in recording.garments.values()]
    late = [k["late_frames"] for k in recording.quality.values() if "late_frames" in k]
    step = np.concatenate(
        [keys["step_ms"] for keys in recording.quality.values() if "step_ms" in keys]
    )
    recovered = [k["recovered"][-1] for k in recording.quality.values() if "recovered" in k]
    resets = [keys["resets"] for keys in recording.quality.values() if "resets" in keys]
    result = meter.result()
    result["finite"] = all(t.finite for t in recording.garments.values())
    pierced = _pierced(recording)
    return {
        "frames": min(len(t) for t in times),
        "rate_hz": round(min(rate(t) for t in times), 3),
        "late_frames": max((late_of(told, frame_rate) for told in late), default=None),
        "step_ms_median": round(float(np.median(step)), 4),
        "step_ms_p95": round(float(np.percentile(step, 95.0)), 4),
        **result,
        "pierced": None if pierced is None else round(pierced.share, 4),
        "pierced_frames": {} if pierced is None else pierced.by_bone,
        "resets": int(max(r[-1] for r in resets)),
        "recovered": int(sum(recovered)),
        "measured_frames": measured,
        "garments": {g.name: _garment(g) for g in garments},
    }


def _pierced(recording: Recording) -> Pierced | None:
    """Body parts that run through garments; None where colliders or their poses are missing."""
    track = recording.colliders
    if track is None:
        return None
    meter = PiercedMeter(track.colliders)
    for k, stamp in enumerate(recording.stamp):
        poses = track.at(int(stamp))
        if poses is not None:
            meter.add(
                poses, {n: (g.positions[k], g.triangles) for n, g in recording.garments.items()}
            )
    result = meter.result()
    return result if result.frames else None


def _mesh(track: GarmentTrack, garment: Garment | None) -> GarmentMesh:
    """What is measured on a garment; the recording alone does not tell how it was cut."""
    mesh = GarmentMesh.from_rest(track.vertices, track.triangles)
    if garment is None or not np.array_equal(garment.triangles, track.triangles):
        return mesh
    if garment.flat is None and garment.rest is None:
        return mesh
    return GarmentMesh.of(garment)


def _garment(garment: Garment) -> dict[str, Any]:
    return {
        "vertices": len(garment.vertices),
        "triangles": len(garment.triangles),
        "pinned_share": round(len(garment.pins) / len(garment.vertices), 5),
    }
