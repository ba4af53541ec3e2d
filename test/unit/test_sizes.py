"""Files and functions stay short; what is longer is listed, and the list may only shrink."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "garment_sim_ros"
MOST_LINES_OF_A_FILE = 400
MOST_LINES = 80
MOST_ARGUMENTS = 12

LONG_FILES: dict[str, int] = {}
"""Files over the limit: their lines."""

LONG_FUNCTIONS = {
    "body/feet_lock.py:hold": (13, 80),
    "body/feet_pass.py:ground": (12, 83),
    "body/mannequin/mesh.py:_collapse": (12, 102),
    "body/retarget_pass.py:turn_joints": (14, 80),
    "body/retarget_pass.py:place_joints": (13, 80),
    "colliders/hulls/hull_placement.py:place": (13, 80),
    "colliders/hulls/hull_simplify.py:_evaluate": (13, 80),
    "colliders/hulls/hull_simplify.py:_delete": (12, 95),
    "colliders/segmentation/feature_points.py:feature_points": (12, 100),
    "contact/distance.py:deepest_shape": (15, 80),
    "contact/mesh/collide.py:_collide": (13, 80),
    "contact/sweep.py:sweep": (12, 120),
    "geometry/mesh_distance.py:_signed_distance": (13, 80),
    "geometry/mvee.py:enclose": (12, 82),
    "recording/bags.py:_read": (12, 82),
}
"""Functions over a limit: most arguments and most lines that each may have."""


def _functions():
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                a = node.args
                arguments = len(a.posonlyargs) + len(a.args) + len(a.kwonlyargs)
                name = f"{path.relative_to(PACKAGE).as_posix()}:{node.name}"
                yield name, arguments, node.end_lineno - node.lineno + 1


def test_files_stay_short():
    lines = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text().splitlines())
        for path in PACKAGE.rglob("*.py")
    }
    long = {name: n for name, n in lines.items() if n > LONG_FILES.get(name, MOST_LINES_OF_A_FILE)}
    assert not long, "split by topic"
    short = {name for name in LONG_FILES if lines.get(name, 0) <= MOST_LINES_OF_A_FILE}
    assert not short, "take these off the list"


def test_functions_stay_short_and_take_few_arguments():
    long, listed = {}, set()
    for name, arguments, lines in _functions():
        if arguments > MOST_ARGUMENTS or lines > MOST_LINES:
            listed.add(name)
        most = LONG_FUNCTIONS.get(name, (MOST_ARGUMENTS, MOST_LINES))
        if arguments > most[0] or lines > most[1]:
            long[name] = (arguments, lines)
    assert not long, "split them, or gather arguments in a NamedTuple"
    assert not set(LONG_FUNCTIONS) - listed, "take these off the list"
