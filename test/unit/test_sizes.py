"""Files and functions stay short."""

import ast
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
PACKAGE = REPOSITORY / "garment_sim_ros"
FOLDERS = ("garment_sim_ros", "test", "bench", "examples", "launch")
MOST_LINES_OF_A_FILE = 400
MOST_LINES = 80
MOST_ARGUMENTS = 12


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
        path.relative_to(REPOSITORY).as_posix(): len(path.read_text().splitlines())
        for folder in FOLDERS
        for path in (REPOSITORY / folder).rglob("*.py")
    }
    assert len(lines) > 500
    long = {name: n for name, n in lines.items() if n > MOST_LINES_OF_A_FILE}
    assert not long, "split by topic"


def test_functions_stay_short_and_take_few_arguments():
    long = {
        name: (arguments, lines)
        for name, arguments, lines in _functions()
        if arguments > MOST_ARGUMENTS or lines > MOST_LINES
    }
    assert not long, "split them, or gather arguments in a NamedTuple"
