"""The renderer shows what is there, where it is."""

import math
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from garment_sim_ros.recording.previews import Figure, Look, animation, moments
from garment_sim_ros.recording.render import (
    Camera,
    RenderingUnavailableError,
    Surface,
    color,
    render,
)

WIDTH, HEIGHT = 120, 100
CAMERA = Camera(position=np.array([4.0, 0.0, 0.5]), target=np.array([0.0, 0.0, 0.5]))


@pytest.fixture(scope="module", autouse=True)
def _ray_caster():
    pytest.importorskip("embreex")


def sphere(radius, center, **look) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return Surface(vertices=mesh.vertices + center, triangles=mesh.faces.astype(np.int32), **look)


def square(size, height, **look) -> Surface:
    """A horizontal square whose outside is up."""
    s = 0.5 * size
    vertices = np.array([[-s, -s, height], [s, -s, height], [s, s, height], [-s, s, height]])
    return Surface(vertices=vertices, triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32), **look)


def test_silhouette_has_the_projected_size():
    picture = render([sphere(0.3, [0, 0, 0.5], color=(1, 0, 0))], CAMERA, WIDTH, HEIGHT)
    red = picture[..., 0].astype(int) - picture[..., 2] > 40
    rows, columns = np.nonzero(red)
    # The outline of a sphere: tan of its angular radius, over tan of half the field of view.
    angle = math.asin(0.3 / 4.0)
    expected = math.tan(angle) / math.tan(0.5 * CAMERA.field_of_view) * HEIGHT
    assert np.ptp(rows) + 1 == pytest.approx(expected, abs=2)
    assert np.ptp(columns) + 1 == pytest.approx(expected, abs=2)
    assert rows.mean() == pytest.approx(0.5 * HEIGHT, abs=1.5)
    assert columns.mean() == pytest.approx(0.5 * WIDTH, abs=1.5)


def test_nearer_surface_hides_the_farther_one():
    near = sphere(0.2, [1.0, 0, 0.5], color=(0, 0, 1))
    far = sphere(0.2, [-1.0, 0, 0.5], color=(1, 0, 0))
    for order in ([near, far], [far, near]):
        middle = render(order, CAMERA, WIDTH, HEIGHT)[HEIGHT // 2, WIDTH // 2]
        assert middle[2] > middle[0]


def test_key_light_comes_from_the_upper_left():
    picture = render([sphere(0.3, [0, 0, 0.5], color=(0.5, 0.5, 0.5))], CAMERA, WIDTH, HEIGHT)
    row, column = HEIGHT // 2, WIDTH // 2
    assert picture[row - 9, column - 6].mean() > picture[row + 9, column + 6].mean() + 30


def test_floor_takes_a_shadow_and_the_inside_is_darker():
    above = Camera(position=np.array([2.0, 0.0, 3.0]), target=np.array([0.0, 0.0, 0.0]))
    empty = square(0.01, -5.0, color=(1, 1, 1))
    plain = render([empty], above, WIDTH, HEIGHT).astype(int)
    shaded = render([square(0.5, 0.4, color=(1, 0, 0))], above, WIDTH, HEIGHT).astype(int)
    floor = np.abs(shaded - shaded.mean(axis=2, keepdims=True)).max(axis=2) < 12
    assert (plain.sum(axis=2) - shaded.sum(axis=2))[floor].max() > 60

    below = Camera(position=np.array([2.0, 0.0, -2.0]), target=np.array([0.0, 0.0, 0.4]))
    pair = [
        render([square(0.8, 0.4, color=(1, 0, 0), inside=i)], below, WIDTH, HEIGHT, floor=-9.0)
        for i in (1.0, 0.3)
    ]
    bright, dark = (p[HEIGHT // 2, WIDTH // 2].astype(int).sum() for p in pair)
    assert dark < 0.8 * bright


def test_light_comes_through_to_the_inside_of_a_closed_garment():
    """Seen through a slit, the inside of a tube is an eighth as bright as its outside."""
    angle = np.linspace(0.2, 2.0 * np.pi - 0.2, 41)
    ring = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low, high = (np.column_stack([ring, np.full(41, z)]) for z in (0.3, 0.7))
    a = np.arange(40)
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + 42], 1), np.stack([a, a + 42, a + 41], 1)]
    ).astype(np.int32)
    tube = Surface(vertices=np.concatenate([low, high]), triangles=triangles, color=(1, 0, 0))
    picture = render([tube], CAMERA, WIDTH, HEIGHT)
    inside = picture[HEIGHT // 2, WIDTH // 2, 0] / 255.0
    behind = Camera(position=np.array([-4.0, 0.0, 0.5]), target=np.array([0.0, 0.0, 0.5]))
    outside = render([tube], behind, WIDTH, HEIGHT)[HEIGHT // 2, WIDTH // 2, 0] / 255.0
    assert (inside / outside) ** 2.2 > 0.12


def test_same_scene_gives_the_same_bytes():
    scene = [sphere(0.3, [0, 0, 0.5], color=color("#336699"), gloss=0.2)]
    first, second = (render(scene, CAMERA, WIDTH, HEIGHT) for _ in range(2))
    assert (first == second).all()


def test_missing_ray_caster_is_a_clear_error(monkeypatch):
    for name in ("embreex.mesh_construction", "embreex.rtcore_scene"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(RenderingUnavailableError, match="embreex"):
        render([sphere(0.3, [0, 0, 0.5], color=(1, 1, 1))], CAMERA, 4, 4)


def test_previews_keep_the_whole_figure_in_the_picture(tmp_path):
    mesh = trimesh.creation.capsule(height=1.2, radius=0.25, count=[12, 12])
    mesh.vertices -= [0, 0, mesh.vertices[:, 2].min()]
    triangles = mesh.faces.astype(np.int32)
    look = Look(skin_triangles=triangles, garment_triangles=(), garment_colours=())
    figures = [
        Figure(skin=mesh.vertices + np.array([x, 0, 0]), garments=(), root=np.array([x, 0.0, 0.9]))
        for x in np.linspace(0.0, 3.0, 3)
    ]
    moments(figures, look, tmp_path / "preview.png", size=(60, 90))
    picture = np.asarray(Image.open(tmp_path / "preview.png")).astype(int)
    assert picture.shape[1] > picture.shape[0]
    warm = picture[..., 0] - picture[..., 2] > 25
    assert warm.any()
    assert not np.concatenate([warm[0], warm[-1], warm[:, 0], warm[:, -1]]).any()

    animation(figures, look, tmp_path / "preview.gif", rate=10.0, size=(40, 60))
    with Image.open(tmp_path / "preview.gif") as film:
        assert film.n_frames == 3
        assert film.info["duration"] == 100
        assert film.info["loop"] == 0


def test_a_film_is_not_dithered(tmp_path):
    """Without dithering few pixels differ from all of their neighbours."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    look = Look(
        skin_triangles=mesh.faces.astype(np.int32), garment_triangles=(), garment_colours=()
    )
    root = np.array([0.0, 0.0, 0.5])
    figure, moved = (
        Figure(skin=mesh.vertices + np.array([0, y, 0.5]), garments=(), root=root)
        for y in (0.0, 0.01)
    )
    animation([figure, moved], look, tmp_path / "preview.gif", rate=20.0)
    with Image.open(tmp_path / "preview.gif") as film:
        assert film.size == (480, 640)
        assert film.info["duration"] == 50
        index = np.asarray(film.convert("RGB")).astype(int) @ [1, 256, 65536]
    inner = index[1:-1, 1:-1]
    around = (index[:-2, 1:-1], index[2:, 1:-1], index[1:-1, :-2], index[1:-1, 2:])
    assert np.all([inner != other for other in around], axis=0).mean() < 0.1
