"""A running avatar as a source of frames for a page."""

import dataclasses
import os
import re
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from rclpy.exceptions import InvalidNamespaceException

from garment_sim_ros.arrays import FloatArray, SingleArray
from garment_sim_ros.colliders.description import MAX_TEXT, from_json
from garment_sim_ros.contact.shapes import ColliderPoses, ColliderSet
from garment_sim_ros.errors import MessageError, ParameterError
from garment_sim_ros.ros.conversions import poses_from, text_from
from garment_sim_ros.ros.diagnostics import Rejections
from garment_sim_ros.ros.garment_conversions import figures_from, mesh_from, points_from
from garment_sim_ros.ros.inputs import Input
from garment_sim_ros.ros.node_client import NodeClient
from garment_sim_ros.ros.own_context import own_context
from garment_sim_ros.ros.pose_buffer import PoseBuffer
from garment_sim_ros.ros.rclpy_internals import Taken
from garment_sim_ros.ros.sources import Source
from garment_sim_ros.ros.topics import (
    COLLIDER_DESCRIPTION,
    COLLIDER_POSES,
    GARMENT_POINTS,
    GARMENT_TOPOLOGY,
    QUALITY,
    Topic,
)
from garment_sim_ros.stepping_back import libraries_step_back
from garment_sim_ros.view.frame import Cloth, Frame
from garment_sim_ros.view.history import History

MOST_GARMENTS = 32
MOST_TRIANGLES = 2_000_000
"""Of all garments together."""
_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
_LOOK = 0.5
"""Between two looks for garments [s]."""
_GONE = 5.0
"""A garment that nobody has published for so long is taken off, if others are there [s]."""
_PATIENCE = 1.0
"""After so long without a usable message another publisher may be followed [s]."""
_ROOM = 60
"""Messages that may come between two frames of the page; all are counted."""
_KEPT = 4
"""Frames of a garment that are kept, to find one that all have."""


class _Garment:
    """What has come of one garment."""

    def __init__(self, inputs: tuple[Input, ...]) -> None:
        self.inputs = inputs
        self.cloth: Cloth | None = None
        self.points: dict[int, SingleArray] = {}
        self.seen = time.monotonic()


class LiveSource:
    """Subscribes to an avatar's topics in a namespace.

    Args:
        namespace: The namespace; may begin with a slash or not.
        frame_id: Frame of everything published; other messages are rejected.

    Attributes:
        cloths: Garments there are, inner ones first.
        colliders: Colliders; None before they were described.
        nodes: Asks the avatar's nodes.
        rejections: Messages that could not be used.

    Raises:
        ParameterError: The namespace cannot be one.
    """

    def __init__(self, namespace: str, frame_id: str) -> None:
        self.cloths: Mapping[str, Cloth] = {}
        self.colliders: ColliderSet | None = None
        self._frame_id = frame_id
        self._context = own_context()
        try:
            self._node = rclpy.create_node(
                f"view_{os.getpid()}",
                namespace="/" + namespace.strip("/"),
                context=self._context,
                start_parameter_services=False,
                enable_rosout=False,
            )
        except InvalidNamespaceException:
            rclpy.shutdown(context=self._context)
            raise ParameterError(
                "--namespace", f"found {namespace!r}", "allowed: names of letters, digits and _"
            ) from None
        self.rejections = Rejections(lambda line: None, lambda line: None)
        self._history = History()
        self._garments: dict[str, _Garment] = {}
        self._quality: dict[str, dict[str, float]] = {}
        self._buffer = PoseBuffer()
        self._poses_at = -1
        self._given = -1
        self._came = 0
        self._last_cloth = -np.inf
        self._next_look = 0.0
        self._own_body: tuple[str, str] | None = None
        self._asks_body = True
        self._inputs = [
            self._take_in(COLLIDER_DESCRIPTION, self._take_description),
            self._take_in(COLLIDER_POSES, self._take_poses),
            self._take_in(QUALITY, self._take_quality),
        ]
        self.nodes = NodeClient(self._node, self._context)

    def __enter__(self) -> "LiveSource":
        libraries_step_back()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.nodes.close()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def set_body(self, body: str | None, bone_names: str, *, none: str) -> None:
        """Which body to show; where None, the one that the cloth node says it has.

        Args:
            body: A file; `none` leaves it out.
            bone_names: YAML file of its bones' names.
            none: The word for no body.
        """
        self._asks_body = body is None
        self._own_body = None if body in (None, none) else (body, bone_names)

    def body(self) -> tuple[str, str] | None:
        """The body to show."""
        return self.nodes.body() if self._asks_body else self._own_body

    def frame(self) -> Frame | None:
        """The newest frame that all garments have; None where there is no other than before."""
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + _LOOK
            self._look_for_garments(now)
        for i in (*self._inputs, *(i for g in self._garments.values() for i in g.inputs)):
            i.take_all()
        self._history.arrive(now, self._came)
        self._came = 0
        worn = {n: g for n, g in self._garments.items() if g.cloth is not None and g.points}
        stamp, positions = _newest(worn)
        if stamp < 0:  # no garments yet: the body alone
            stamp = self._poses_at
        if stamp in (-1, self._given):
            return None
        self._given = stamp
        frame = Frame(
            stamp=stamp, positions=positions, poses=self._poses(stamp), quality=self._quality
        )
        self._history.add(now, frame)
        return frame

    def words(self) -> str:
        """Rate, silence, and what was rejected."""
        now = time.monotonic()
        silent = now - self._last_cloth
        if not self.cloths:
            text = "waits for garments"
        elif silent > _PATIENCE:
            text = f"no garments for {silent:.0f} s"
        else:
            text = f"cloth at {self._history.rate(now):.0f} Hz"
        counts = sorted(self.rejections.counts.items())
        if counts:
            text += "; rejected: " + ", ".join(f"{n} {r.replace('_', ' ')}" for r, n in counts)
        return text

    def graphs(self) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, ...]]:
        """Rate, and errors, of the last minute."""
        now = time.monotonic()
        return self._history.rates(now), self._history.errors(now)

    def _poses(self, stamp: int) -> ColliderPoses | None:
        if self.colliders is None or not len(self._buffer):
            return None
        poses = ColliderPoses.identity(len(self.colliders))
        self._buffer.at(stamp, poses)
        self._buffer.forget_before(stamp)
        return poses

    def _take_in(self, topic: Topic, take: Any) -> Input:
        # Not reliably but what is latched: nobody waits for a page that is slow.
        asked = dataclasses.replace(topic, subscribed_reliably=topic.latched)
        return Input(
            self._node,
            asked,
            take,
            rejected=self.rejections.add,
            source=Source(_PATIENCE),
            room=0 if topic.latched else _ROOM,
        )

    def _look_for_garments(self, now: float) -> None:
        own = self._node.get_namespace().rstrip("/") + "/garments/"
        kind = GARMENT_TOPOLOGY.kind
        for topic, kinds in self._node.get_topic_names_and_types():
            name, _, rest = topic.removeprefix(own).partition("/")
            if not topic.startswith(own) or rest != "topology" or kind not in kinds:
                continue
            if not _NAME.fullmatch(name):
                continue
            known = self._garments.get(name)
            if known is None and len(self._garments) < MOST_GARMENTS:
                self._subscribe(name)
            elif known is not None and self._node.count_publishers(topic):
                known.seen = now
        here = [g for g in self._garments.values() if now - g.seen < _GONE]
        for name, garment in list(self._garments.items()):
            if here and now - garment.seen >= _GONE:
                for i in garment.inputs:
                    i.destroy()
                del self._garments[name]
                self._dress()

    def _subscribe(self, name: str) -> None:
        named = [
            dataclasses.replace(t, name=t.name.format(name))
            for t in (GARMENT_TOPOLOGY, GARMENT_POINTS)
        ]
        self._garments[name] = _Garment(
            (
                self._take_in(named[0], lambda taken: self._take_topology(name, taken)),
                self._take_in(named[1], lambda taken: self._take_points(name, taken)),
            )
        )

    def _take_topology(self, name: str, taken: Taken) -> None:
        vertices, triangles = mesh_from(taken.data)
        others = sum(len(c.triangles) for n, c in self.cloths.items() if n != name)
        if others + len(triangles) > MOST_TRIANGLES:
            raise MessageError("too_many", f"over {MOST_TRIANGLES} triangles of all garments")
        garment = self._garments[name]
        same = (
            garment.cloth is not None
            and np.array_equal(garment.cloth.vertices, vertices)
            and np.array_equal(garment.cloth.triangles, triangles)
        )
        if not same:
            garment.cloth = Cloth(vertices=vertices, triangles=triangles)
            garment.points.clear()
            self._dress()

    def _take_points(self, name: str, taken: Taken) -> None:
        garment = self._garments[name]
        if garment.cloth is None:
            return  # its topology is on its way
        found = points_from(taken.data, len(garment.cloth.vertices))
        self._check_frame(found.frame_id)
        if garment.points and found.stamp < max(garment.points):
            garment.points.clear()  # time began anew
        garment.points[found.stamp] = found.points
        while len(garment.points) > _KEPT:
            del garment.points[min(garment.points)]
        self._last_cloth = time.monotonic()
        # The rate is that of one garment: all come together.
        self._came += name == next(iter(self._garments))

    def _take_quality(self, taken: Taken) -> None:
        _, figures = figures_from(taken.data)
        before = [n for n in self._quality if n in self._garments]
        self._quality = figures
        if before != [n for n in figures if n in self._garments]:
            self._dress()

    def _take_description(self, taken: Taken) -> None:
        self.colliders = from_json(text_from(taken.data, MAX_TEXT))
        self._buffer.clear()

    def _take_poses(self, taken: Taken) -> None:
        found = poses_from(taken.data)
        self._check_frame(found.frame_id)
        if self.colliders is None:
            return  # their description is on its way
        if len(found.poses.position) != len(self.colliders):
            raise MessageError(
                "pose_count",
                f"found {len(found.poses.position)} poses; allowed: {len(self.colliders)}",
            )
        if len(self._buffer) and found.stamp <= self._buffer.newest[0]:
            self._buffer.clear()  # time began anew
        self._buffer.add(found.stamp, found.poses)
        self._poses_at = found.stamp

    def _check_frame(self, frame_id: str) -> None:
        if frame_id != self._frame_id:
            raise MessageError("frame_id", f"found {frame_id!r}; allowed: {self._frame_id!r}")

    def _dress(self) -> None:
        """A new table of the garments, in the order that `quality` has them."""
        known = {n: g.cloth for n, g in self._garments.items() if g.cloth is not None}
        told = [n for n in self._quality if n in known]
        self.cloths = {n: known[n] for n in (*told, *sorted(set(known) - set(told)))}


def _newest(worn: Mapping[str, _Garment]) -> tuple[int, dict[str, SingleArray]]:
    """Newest time [ns] that all garments have, else that of each, and their points then."""
    if not worn:
        return -1, {}
    common = set.intersection(*(set(g.points) for g in worn.values()))
    if common:
        stamp = max(common)
        return stamp, {n: g.points[stamp] for n, g in worn.items()}
    stamp = max(max(g.points) for g in worn.values())
    return stamp, {n: g.points[max(g.points)] for n, g in worn.items()}
