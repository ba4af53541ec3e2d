"""Pictures of bodies and garments, traced on the CPU without a display.

One renderer for all previews: primary rays on a regular sub-pixel grid, smooth normals, a soft
key light, a sky that dims where near geometry hides it, and a floor that takes the shadows.
Sample patterns depend on the pixel only, so that the same scene gives the same picture.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garment_sim_ros.arrays import AnyArray
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.geometry.topology import vertex_normals

Color = tuple[float, float, float]


class RenderingUnavailableError(GarmentSimError):
    """The ray caster is not installed on this machine."""


_SUPERSAMPLING = 2  # primary rays along each side of a pixel
_SHADOW_RAYS = 2  # of each primary ray, times the quality
_SKY_RAYS = 3
_SKY_REACH = 0.5  # farther geometry does not dim the sky [m]
_LIFT = 8e-4  # secondary rays start off the surface by this, well under a cloth's thickness [m]
_LIGHT_RADIUS = 0.09  # of the key light, as an angle [rad]
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))

_BACKDROP = np.array([0.80, 0.82, 0.85], np.float32)
_FLOOR = np.array([0.66, 0.67, 0.70], np.float32)
_FLOOR_CELL = 0.5  # spacing of the lines on the floor [m]
_FLOOR_LINE = 0.14  # how much darker they are
_FLOOR_LINE_WIDTH = 0.006  # half of it [m]
_THROUGH = 0.45  # of the sky's light that comes to the inside of cloth through it
_KEY = np.array([2.15, 2.05, 1.90], np.float32)
_SKY_UP = np.array([0.62, 0.67, 0.76], np.float32)
_SKY_DOWN = np.array([0.36, 0.33, 0.31], np.float32)


def color(code: str) -> Color:
    """Linear colour from an sRGB code such as ``"#c8553d"``."""
    r, g, b = (int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return linear((r, g, b))


def linear(srgb: Color) -> Color:
    """Linear colour from an sRGB one, of 0 to 1."""
    r, g, b = (((v + 0.055) / 1.055) ** 2.4 if v > 0.04045 else v / 12.92 for v in srgb)
    return r, g, b


SKIN_COLOR = color("#d2b8a3")


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A mesh with its look.

    Attributes:
        vertices: World positions [m], shape [v, 3].
        triangles: Vertex indices, counter-clockwise seen from outside, shape [t, 3].
        color: Linear colour of the outside.
        inside: Brightness of the inside relative to the outside.
        gloss: Strength of the highlight.
    """

    vertices: AnyArray
    triangles: NDArray[np.int32]
    color: Color
    inside: float = 0.75
    gloss: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A perspective camera.

    Attributes:
        position: Eye in the world frame [m], shape [3].
        target: Point in the middle of the picture [m], shape [3].
        field_of_view: Vertical opening angle [rad].
    """

    position: AnyArray
    target: AnyArray
    field_of_view: float = math.radians(24.0)

    def axes(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Unit vectors of the picture in the world: right, up, forward."""
        forward = np.asarray(self.target, float) - np.asarray(self.position, float)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return right, np.cross(right, forward), forward


def render(
    surfaces: Sequence[Surface],
    camera: Camera,
    width: int,
    height: int,
    *,
    floor: float = 0.0,
    quality: int = 1,
) -> NDArray[np.uint8]:
    """A picture of `surfaces` standing on a floor.

    Args:
        surfaces: What is to be seen.
        camera: Where it is seen from; the key light comes from the camera's upper left.
        width: Of the picture [pixel].
        height: Of the picture [pixel].
        floor: Height of the floor [m].
        quality: Multiplies the rays that go to the light and the sky.

    Returns:
        sRGB picture, shape [height, width, 3].

    Raises:
        RenderingUnavailableError: The ray caster is not installed.
    """
    n = _SUPERSAMPLING
    scene = _Scene(surfaces)
    origin = np.asarray(camera.position, np.float32)
    direction, samples = _primary_rays(camera, width, height, quality)
    light = _light_direction(camera)
    picture = np.broadcast_to(_BACKDROP, direction.shape).copy()

    hit = scene.cast(origin, direction)
    with np.errstate(divide="ignore"):
        to_floor = (origin[2] - floor) / np.maximum(-direction[:, 2], 0.0)
    seen = (hit["primID"] >= 0) & ~(hit["tfar"] > to_floor)  # nothing is seen below the floor
    on_floor = (to_floor > 0.0) & np.isfinite(to_floor) & ~seen

    index = np.flatnonzero(seen)
    hit = {key: value[index] for key, value in hit.items()}
    picture[index] = _shade_surfaces(
        scene, hit, origin, direction[index], light, samples.at(index)
    )
    index = np.flatnonzero(on_floor)
    point = origin + to_floor[index, None] * direction[index]
    picture[index] = _shade_floor(scene, point, camera, light, samples.at(index))

    return _to_srgb(picture.reshape(height, n, width, n, 3).mean(axis=(1, 3)))


class _Scene:
    """Surfaces joined into one mesh, ready for ray casting."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError:
            raise RenderingUnavailableError(
                "pictures need the ray caster embreex; install it with: pip install embreex"
            ) from None
        offsets = np.cumsum([0] + [len(s.vertices) for s in surfaces])
        self.vertices = np.concatenate([s.vertices for s in surfaces]).astype(np.float32)
        self.triangles = np.concatenate(
            [s.triangles + offset for s, offset in zip(surfaces, offsets)]
        ).astype(np.int32)
        self.normals = np.empty_like(self.vertices)
        vertex_normals(self.vertices, self.triangles, self.normals)
        owner = np.repeat(np.arange(len(surfaces)), [len(s.triangles) for s in surfaces])
        self.color = np.array([s.color for s in surfaces], np.float32)[owner]
        self.inside = np.array([s.inside for s in surfaces], np.float32)[owner]
        self.gloss = np.array([s.gloss for s in surfaces], np.float32)[owner]
        self._scene = EmbreeScene(robust=True)
        TriangleMesh(self._scene, self.vertices, self.triangles)

    def cast(self, origin: AnyArray, direction: AnyArray) -> dict[str, AnyArray]:
        """Nearest hits: primID (-1 for none), u, v, tfar, Ng."""
        origins = np.broadcast_to(origin, direction.shape).copy()
        return self._scene.run(origins, direction, output=1)

    def visible(
        self, origin: AnyArray, direction: AnyArray, reach: float = 1e9
    ) -> NDArray[np.bool_]:
        """Whether rays meet nothing within `reach` [m]."""
        reaches = np.full(len(origin), reach, np.float32)
        return self._scene.run(origin, direction, dists=reaches, query="OCCLUDED") == -1

    def over(self, point: AnyArray, way: AnyArray, reach: float) -> NDArray[np.intp]:
        """Indices of floor points within `reach` of the meshes, or of their shift by `way` [m]."""
        low, high = self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)
        offset = point[:, :2] - 0.5 * (low + high)
        along = np.clip(offset @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
        distance = np.linalg.norm(offset - along[:, None] * way, axis=1)
        return np.flatnonzero(distance < 0.5 * np.linalg.norm(high - low) + reach)


@dataclass(frozen=True)
class _Samples:
    """Which of a pixel's secondary rays each primary ray casts.

    A pixel's primary rays share out one even pattern, turned by a pixel's own angle: so few
    rays each are enough.

    Attributes:
        index: Of the primary ray within its pixel, shape [n].
        turn: Of the pattern, in [0, 1), shape [n].
        quality: See `render`.
    """

    index: AnyArray
    turn: AnyArray
    quality: int

    def at(self, rays: NDArray[np.intp]) -> "_Samples":
        """Those of some primary rays."""
        return _Samples(self.index[rays], self.turn[rays], self.quality)

    def disc(self, rays: int) -> Iterator[tuple[AnyArray, AnyArray]]:
        """Points of the unit disc for each primary ray, as x and y of shape [n].

        Args:
            rays: How many, at quality 1.
        """
        count = _SUPERSAMPLING**2
        total = rays * self.quality * count
        for i in range(rays * self.quality):
            place = self.index + np.float32(i * count)
            radius = np.sqrt((place + np.float32(0.5)) / np.float32(total))
            angle = np.float32(_GOLDEN_ANGLE) * place + np.float32(2.0 * math.pi) * self.turn
            yield radius * np.cos(angle), radius * np.sin(angle)


def _primary_rays(
    camera: Camera, width: int, height: int, quality: int
) -> tuple[AnyArray, _Samples]:
    """Unit directions row by row, shape [height n * width n, 3]."""
    n = _SUPERSAMPLING
    right, up, forward = (axis.astype(np.float32) for axis in camera.axes())
    half = math.tan(0.5 * camera.field_of_view)
    x = np.arange(width * n, dtype=np.float32)
    y = np.arange(height * n, dtype=np.float32)
    across = ((x + 0.5) / (width * n) * 2.0 - 1.0) * np.float32(half * width / height)
    above = (1.0 - (y + 0.5) / (height * n) * 2.0) * np.float32(half)
    direction = across[None, :, None] * right + above[:, None, None] * up + forward
    direction /= np.sqrt(np.square(direction).sum(axis=-1, keepdims=True))

    # Interleaved gradient noise: even over any small neighbourhood. Jimenez, "Next generation
    # post processing in Call of Duty: Advanced Warfare", SIGGRAPH 2014 courses.
    inner = 0.06711056 * (x[None, :] // n) + 0.00583715 * (y[:, None] // n)
    turn = np.mod(52.9829189 * np.mod(inner, 1.0), 1.0)
    index = (y[:, None] % n) * n + x[None, :] % n
    samples = _Samples(index.ravel(), turn.ravel().astype(np.float32), quality)
    return direction.reshape(-1, 3), samples


def _light_direction(camera: Camera) -> AnyArray:
    """Unit vector towards the key light: over the camera's left shoulder."""
    right, _, forward = camera.axes()
    back = -np.array([forward[0], forward[1], 0.0])
    back /= np.linalg.norm(back)
    light = -0.75 * right + 0.62 * back + np.array([0.0, 0.0, 1.05])
    return (light / np.linalg.norm(light)).astype(np.float32)


def _shade_surfaces(
    scene: _Scene,
    hit: dict[str, AnyArray],
    origin: AnyArray,
    direction: AnyArray,
    light: AnyArray,
    samples: _Samples,
) -> AnyArray:
    """Linear colours at hits on the meshes, shape [n, 3]."""
    corners = scene.triangles[hit["primID"]]
    u, v = hit["u"][:, None], hit["v"][:, None]
    normals = scene.normals[corners]
    normal = (1.0 - u - v) * normals[:, 0] + u * normals[:, 1] + v * normals[:, 2]
    a, b, c = (scene.vertices[corners[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-20)
    # Each side of a cloth is lit from its own side.
    from_inside = (flat * direction).sum(axis=1) > 0.0
    side = np.where(from_inside, -1.0, 1.0).astype(np.float32)[:, None]
    flat, normal = flat * side, normal * side
    normal = _facing(normal, direction)

    base = scene.color[hit["primID"]]
    base = base * np.where(from_inside, scene.inside[hit["primID"]], 1.0)[:, None]
    point = origin + hit["tfar"][:, None] * direction + _LIFT * flat
    facing = np.maximum((normal * light).sum(axis=1), 0.0)
    key = facing * _light_seen(scene, point, light, samples)
    sky = _sky_seen(scene, point, normal, samples)
    sky = np.where(from_inside, np.maximum(sky, np.float32(_THROUGH)), sky)
    up = 0.5 + 0.5 * normal[:, 2:3]
    ambient = (_SKY_UP * up + _SKY_DOWN * (1.0 - up)) * sky[:, None]
    shaded = base * (key[:, None] * _KEY * 0.42 + ambient)

    half = light - direction
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    highlight = np.maximum((normal * half).sum(axis=1), 0.0) ** 28
    rim = (1.0 - np.abs((normal * direction).sum(axis=1))) ** 3 * sky
    gloss = scene.gloss[hit["primID"]]
    return shaded + ((highlight * key * gloss) + 0.07 * rim)[:, None]


def _facing(normal: AnyArray, direction: AnyArray) -> AnyArray:
    """Unit smooth normals, bent so that none points away from the eye."""
    away = np.maximum((normal * direction).sum(axis=1, keepdims=True) + 0.02, 0.0)
    normal = normal - away * direction
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)


def _shade_floor(
    scene: _Scene, point: AnyArray, camera: Camera, light: AnyArray, samples: _Samples
) -> AnyArray:
    """Linear colours of the floor, fading into the backdrop with distance, shape [n, 3]."""
    point = point + np.array([0.0, 0.0, _LIFT], np.float32)
    height = float(scene.vertices[:, 2].max() - point[0, 2]) if len(point) else 0.0
    lit = np.ones(len(point), np.float32)
    # Shadows fall along the light's way, blurred at its end.
    index = scene.over(point, -light[:2] * (height / light[2]), 2.0 * _LIGHT_RADIUS * height)
    lit[index] -= 0.22 * (1.0 - _light_seen(scene, point[index], light, samples.at(index)))
    index = scene.over(point, np.zeros(2, np.float32), _SKY_REACH)
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (len(index), 3))
    lit[index] -= 0.36 * (1.0 - _sky_seen(scene, point[index], up, samples.at(index)))

    distance = np.linalg.norm(point[:, :2] - np.asarray(camera.target, np.float32)[:2], axis=1)
    place = point[:, :2] / np.float32(_FLOOR_CELL)
    line = np.abs(place - np.round(place)).min(axis=1) * _FLOOR_CELL < _FLOOR_LINE_WIDTH
    lit *= 1.0 - _FLOOR_LINE * line * np.clip(1.5 - distance / 2.5, 0.0, 1.0)
    fade = np.clip((distance - 1.2) / 4.5, 0.0, 1.0)[:, None]
    fade *= fade * (3.0 - 2.0 * fade)
    return _FLOOR * lit[:, None] * (1.0 - fade) + _BACKDROP * fade


def _light_seen(scene: _Scene, point: AnyArray, light: AnyArray, samples: _Samples) -> AnyArray:
    """Share of the key light's disc that each point sees, shape [n]."""
    first, second = (np.float32(_LIGHT_RADIUS) * axis for axis in _tangents(light[None, :]))
    seen = np.zeros(len(point), np.float32)
    for x, y in samples.disc(_SHADOW_RAYS):
        seen += scene.visible(point, light + x[:, None] * first + y[:, None] * second)
    return seen / np.float32(_SHADOW_RAYS * samples.quality)


def _sky_seen(scene: _Scene, point: AnyArray, normal: AnyArray, samples: _Samples) -> AnyArray:
    """Share of the hemisphere (weighted by the cosine) that nothing near hides, shape [n]."""
    first, second = _tangents(normal)
    seen = np.zeros(len(point), np.float32)
    for x, y in samples.disc(_SKY_RAYS):
        rise = np.sqrt(np.maximum(1.0 - x * x - y * y, np.float32(0.02)))
        ray = x[:, None] * first + y[:, None] * second + rise[:, None] * normal
        seen += scene.visible(point, ray, _SKY_REACH)
    return seen / np.float32(_SKY_RAYS * samples.quality)


def _tangents(normal: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Two unit vectors across each unit normal, shape [n, 3] each.

    Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017, listing 3.
    """
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    sign = np.copysign(np.float32(1.0), z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return first, np.stack([b, sign + y * y * a, -y], axis=1)


def _to_srgb(linear: AnyArray) -> NDArray[np.uint8]:
    """Linear light to 8-bit sRGB, with a soft shoulder instead of a hard clip."""
    shoulder = 0.8
    over = np.maximum(linear - shoulder, 0.0)
    linear = np.minimum(linear, shoulder) + (1.0 - shoulder) * (
        1.0 - np.exp(-over / (1.0 - shoulder))
    )
    curve = np.where(
        linear > 0.0031308, 1.055 * np.maximum(linear, 1e-9) ** (1.0 / 2.4) - 0.055, 12.92 * linear
    )
    return (np.clip(curve, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
