"""Pictures of a fit: the skin with its colliders, and its division into regions."""

import colorsys
from pathlib import Path

import numpy as np
from PIL import Image

from garment_sim_ros.body.skin import Body
from garment_sim_ros.collider_params import EllipsoidSettings
from garment_sim_ros.colliders.ellipsoids.ellipsoids import segment_body
from garment_sim_ros.colliders.ellipsoids.thresholds import REGIONS
from garment_sim_ros.colliders.posing import ColliderPoser
from garment_sim_ros.colliders.report.surfaces import surface
from garment_sim_ros.contact.shapes import ColliderSet
from garment_sim_ros.geometry.transforms import matrix_from_quaternion
from garment_sim_ros.recording.render import SKIN_COLOR, Camera, Surface, render

_FRONT, _SIDE, _BACK = (2.5, 0.8, 0.2), (0.3, 2.6, 0.2), (-2.5, 0.8, 0.2)
_WIDTH, _HEIGHT = 480, 760  # of one view [pixels]


def draw_fit(body: Body, colliders: ColliderSet, path: Path) -> None:
    """Draw the skin, and the skin with its colliders from front and side."""
    T_world_bone = np.asarray(np.linalg.inv(body.skin.T_bone_bind), np.float64)
    poses = ColliderPoser(colliders, body).poses(T_world_bone)
    skin = Surface(vertices=body.skin.vertices, triangles=body.skin.triangles, color=SKIN_COLOR)
    fitted = [skin]
    for collider, position, orientation in zip(
        colliders.colliders, poses.position, poses.orientation
    ):
        if collider.shape is not None:
            vertices, triangles = surface(collider)
            vertices = vertices @ matrix_from_quaternion(orientation).T + position
            color = _color(len(fitted), 0.6)
            fitted.append(Surface(vertices=vertices, triangles=triangles, color=color))
    _views([[skin], fitted, fitted], (_FRONT, _FRONT, _SIDE), path)


def draw_regions(body: Body, settings: EllipsoidSettings, path: Path) -> None:
    """Draw the skin from front and back, one colour per region that ellipsoids are fitted to.

    A triangle has the colour of most of its corners.

    Raises:
        GeometryError: The body is no human.
        ParameterError: A segmentation without regions.
    """
    s = settings
    divided = segment_body(body, s.segmentation, sex=s.sex, paths=s.paths)
    region = divided.region[body.skin.triangles]
    of_triangle = np.where(region[:, 1] == region[:, 2], region[:, 1], region[:, 0])
    surfaces = [
        Surface(
            vertices=body.skin.vertices,
            triangles=body.skin.triangles[of_triangle == i],
            color=_color(i, 0.5 + 0.25 * (i % 2)),
        )
        for i in range(len(REGIONS))
    ]
    _views([surfaces, surfaces], (_FRONT, _BACK), path)


def _color(number: int, saturation: float) -> tuple[float, float, float]:
    """By the golden section of the colour circle: neighbours differ."""
    return colorsys.hsv_to_rgb(0.381966 * number % 1.0, saturation, 0.8)


def _views(
    figures: list[list[Surface]], directions: tuple[tuple[float, float, float], ...], path: Path
) -> None:
    """Figures side by side, each seen from its own direction."""
    x = np.concatenate([surface.vertices for surface in figures[-1]])
    target = 0.5 * (x.min(axis=0) + x.max(axis=0))
    *across, up = np.ptp(x, axis=0)
    size = float(max(up, max(across) * _HEIGHT / _WIDTH))  # arms stretched out fit, too
    pictures = [
        render(
            surfaces,
            Camera(position=target + size * np.asarray(direction), target=target),
            _WIDTH,
            _HEIGHT,
            floor=float(x[:, 2].min()),
        )
        for surfaces, direction in zip(figures, directions)
    ]
    Image.fromarray(np.concatenate(pictures, axis=1)).save(path)
