"""Which axis of a BVH file is up, and where its body faces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.mocap.bvh import load_bvh
from test.bvh_figure import bvh_text, standing_rows


@pytest.fixture
def load(tmp_path):
    def load(text, **options):
        path = tmp_path / "clip.bvh"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_bvh(path, **options)

    return load


def _world(clip, q):
    T = ForwardKinematics(clip.rig).from_dofs(q, clip.T_world_file)
    return dict(zip(clip.rig.joint_names, T))


@pytest.mark.parametrize("up", range(3))
@pytest.mark.parametrize("up_sign", [1, -1])
@pytest.mark.parametrize("facing", range(4))
def test_any_axis_up_and_any_facing(load, up, up_sign, facing):
    to_up = np.zeros((3, 3))  # rows: where the figure's x, y, z point in the file
    to_up[1, up] = up_sign
    to_up[2, (up + 1) % 3] = 1.0
    to_up[0] = np.cross(to_up[1], to_up[2])
    turn = to_up.T @ Rotation.from_euler("y", 90 * facing, degrees=True).as_matrix()
    rows = standing_rows(10, turn=turn)
    clip = load(bvh_text(rows, turn=turn))
    world = _world(clip, np.where(clip.rig.dofs.kind == 0, 0.0, clip.values[0]))
    assert world["Head"][2, 3] - world["LeftFoot"][2, 3] == pytest.approx(1.49)
    np.testing.assert_allclose(
        world["LeftArm"][:3, 3] - world["RightArm"][:3, 3], [0.0, 0.36, 0.0], atol=1e-9
    )


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_somebody_who_lies_does_not_stand_on_a_wall(load, pitch):
    """The zero pose stands along y; all of the motion is level, face down or up, on y = 0."""
    rows = standing_rows(60, height=0.08)
    rows[:, 2] += np.linspace(0.3, 0.9, 60)  # it slides along
    rows[:, 4] += pitch
    clip = load(bvh_text(rows))
    assert any("Up is +Y" in note for note in clip.notes)
    world = _world(clip, clip.values[30])
    np.testing.assert_allclose([T[2, 3] for T in world.values()], 0.1, atol=0.2)


@pytest.mark.parametrize(
    ("height", "ahead"), [(0.91, 0.0), (0.91, 0.1), (0.91, 0.5), (0.0, 0.0), (0.0, 0.5)]
)
def test_somebody_who_stands_does_not_lie(load, height, ahead):
    """The zero pose stands along y, the motion along z: on z = 0, or with the hips there."""
    rows = standing_rows(60)
    rows[:, :3] = [0.0, ahead, height]
    rows[:, 4] += 90.0
    clip = load(bvh_text(rows))
    assert any("Up is +Z" in note for note in clip.notes)
    world = _world(clip, clip.values[30])
    assert world["Head"][2, 3] - world["LeftFoot"][2, 3] == pytest.approx(1.49, abs=0.05)
