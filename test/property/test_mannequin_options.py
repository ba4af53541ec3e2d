import trimesh
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from garment_sim_ros.body.mannequin.mannequin import mannequin


@settings(
    max_examples=4,
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),  # a body takes about a second: no shrinking
)
@given(
    height=st.floats(1.0, 2.5),
    sex=st.floats(0.0, 1.0),
    build=st.floats(0.0, 1.0),
    vertices=st.integers(1000, 3000),
)
def test_every_option_gives_a_closed_body(height, sex, build, vertices):
    body = mannequin(height=height, sex=sex, build=build, vertices=vertices)
    mesh = trimesh.Trimesh(body.skin.vertices, body.skin.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert mesh.body_count == 1
    assert abs(len(mesh.vertices) - vertices) <= 1
    assert 9.5 < 1000.0 * mesh.volume / height**3 < 20.0
