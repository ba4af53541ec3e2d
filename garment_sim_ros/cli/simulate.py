"""`simulate`: a clip or a recording to a recording with garments, faster than real time."""

import argparse
import dataclasses
import re
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from garment_sim_ros.cli.machines import over_machines
from garment_sim_ros.cli.preset_options import (
    add_preset_options,
    choice_of,
    refuse_doubly_said,
)
from garment_sim_ros.cli.processes import over_processes
from garment_sim_ros.cli.progress import progress
from garment_sim_ros.cli.staging import remove_staged, staged
from garment_sim_ros.errors import GarmentSimError, InputFileError, ParameterError
from garment_sim_ros.mocap.clip_name import file_and_animation
from garment_sim_ros.presets import preset_values

if TYPE_CHECKING:
    from garment_sim_ros.ros.offline.inputs import Input, Message

EXAMPLE = "garment-sim simulate --clip dance.bvh --body avatar.glb --out dance"

_MOST_JOBS = 256
_BUILT_IN = ("", "walk", "mannequin")
_LOOK = 50
"""Messages between two looks at whether a recording is still wanted."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add("--clip", metavar="F", nargs="+", default=[], help="BVH or glTF file, rosbag2, or walk")
    add(
        "--bag",
        metavar="F",
        nargs="+",
        default=[],
        help="rosbag2 with joint_states and robot_description, or with collider_poses and "
        "collider_description; its messages and their times are kept as they are",
    )
    add("--body", metavar="F", default="mannequin", help="body file (default: mannequin)")
    add("--body-bone-names", metavar="F", default="", help="YAML file of the body's bones")
    add("--bone-names", metavar="F", default="", help="YAML file of the clip's bones")
    add("--outfit", metavar="F", default="", help="outfit YAML (default: T-shirt, short skirt)")
    add(
        "--seconds",
        metavar="S",
        type=float,
        help="length, with --clip; a shorter clip is looped; default: once through the clip",
    )
    add("--rate", metavar="HZ", type=float, default=0.0, help="of a clip; default: its own")
    add("--namespace", metavar="NS", help="of the avatar in a bag; default: the first")
    add(
        "--begin-with",
        choices=("joint_states", "collider_poses"),
        default="",
        help="what of a bag is used; default: joint_states where there are any",
    )
    add_preset_options(parser)
    add("--markers", action="store_true", help="also write what RViz shows, which takes room")
    add("--normals", action="store_true", help="points with vertex normals")
    add("--out", metavar="BAG", type=Path, help="the recording; of several inputs their folder")
    add("--jobs", metavar="N", type=int, default=1, help="processes for several inputs")
    add(
        "--scheduler",
        metavar="ADDRESS",
        default="",
        help="simulate on the workers of this scheduler of dask.distributed, tcp://HOST:PORT; "
        "files have the same paths there",
    )
    add(
        "--resume",
        action="store_true",
        help="keep recordings in --out that are complete, and go on with interrupted ones from "
        "their last whole second",
    )
    add("--verify", metavar="BAG", help="simulate a recording of this command again and compare")


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Task:
    """One input, and where its recording goes.

    Attributes:
        mark: Of what is in the making, the same for all inputs of one run.
    """

    mark: str
    option: str
    source: str
    out: Path
    nodes: dict[str, dict[str, Any]]
    begin_with: str
    namespace: str | None
    seconds: float | None
    markers: bool
    resume: bool


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate, or compare."""
    if args.verify is not None:
        return _verify(args)
    if args.scheduler:
        _name_from_anywhere(args)
    tasks = _tasks(args)
    if not 1 <= args.jobs <= _MOST_JOBS:
        raise ParameterError("--jobs", f"found {args.jobs}", f"allowed: 1 to {_MOST_JOBS}")
    began = time.monotonic()
    here = len(tasks) == 1 and not args.scheduler
    results = [_simulated(tasks[0], show=True)] if here else _spread(tasks, args)
    for result in results:
        print(_line(result))
    took = time.monotonic() - began
    return {"recordings": results, "took_s": round(took, 2)}


def _verify(args: argparse.Namespace) -> dict[str, Any]:
    if args.clip or args.bag or args.out:
        raise ParameterError("--verify", "found beside an input or --out", "allowed: alone")
    recording = _offline()
    result: dict[str, Any] = recording.verify(args.verify, _bar)
    print(f"{args.verify}: all {result['seconds']} seconds are the same")
    return result


def _offline() -> Any:
    """What simulates; not loaded with the command, as it needs the types of messages."""
    try:
        from garment_sim_ros.ros.offline import recording
    except ImportError as error:
        raise GarmentSimError(
            f"message types: {error}; source ROS 2 or pip install 'garment_sim_ros[ros]'"
        ) from None
    return recording


def _bar(messages: "Iterator[Message]", count: int) -> "Iterator[Message]":
    return progress(messages, "simulating", count)


def _tasks(args: argparse.Namespace) -> list[_Task]:
    inputs = [("--clip", s) for s in args.clip] + [("--bag", s) for s in args.bag]
    if not inputs or args.out is None:
        raise ParameterError(
            "--out" if inputs else "--clip", "missing", "allowed: --clip F or --bag F, --out BAG"
        )
    for option in ("seconds", "rate") if not args.clip else ():
        if getattr(args, option):
            raise ParameterError(f"--{option}", "found without --clip", "allowed: with it")
    for option in ("namespace", "begin_with") if not args.bag else ():
        if getattr(args, option):
            name = option.replace("_", "-")
            raise ParameterError(f"--{name}", "found without --bag", "allowed: with it")
    names = [_name_of(source) for _, source in inputs]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(inputs[0][0], f"two inputs named {name!r}", "allowed: one each")
    nodes, mark = _nodes(args), uuid.uuid4().hex
    tasks = []
    for (option, source), name in zip(inputs, names):
        clip = {"clip": source, "rate": args.rate} if option == "--clip" else {}
        tasks.append(
            _Task(
                mark=mark,
                option=option,
                source=source,
                out=args.out if len(inputs) == 1 else args.out / name,
                nodes={**nodes, "mocap_player": {**nodes["mocap_player"], **clip}},
                begin_with=args.begin_with,
                namespace=_namespace(args.namespace),
                seconds=args.seconds,
                markers=args.markers,
                resume=args.resume,
            )
        )
        _check_out(tasks[-1].out)
    return tasks


def _name_of(source: str) -> str:
    """What the recording of an input is called among others."""
    file, animation = file_and_animation(source)
    name = Path(file).stem.replace(":", "_")
    return name if animation is None else name + "_" + re.sub(r"[^-.\w]", "_", animation)


def _name_from_anywhere(args: argparse.Namespace) -> None:
    """Give files their whole path: workers stand in other folders."""

    def whole(name: str) -> str:
        file, _ = file_and_animation(name)
        if file in _BUILT_IN or not Path(file).exists():
            return name
        return str(Path(file).absolute()) + name[len(file) :]

    for option in ("body", "body_bone_names", "bone_names", "outfit"):
        setattr(args, option, whole(getattr(args, option)))
    args.clip, args.bag = [whole(n) for n in args.clip], [whole(n) for n in args.bag]
    args.out = args.out and args.out.absolute()


def _nodes(args: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Parameters by node, but for the clip."""
    choice = choice_of(args)
    worn = {"body": args.body, "body_bone_names": args.body_bone_names, "outfit": args.outfit}
    own: dict[str, dict[str, Any]] = {
        "mocap_player": {"clip": "", "rate": 0.0, "bone_names": args.bone_names},
        "collider_node": {**worn, "bone_names": args.bone_names},
        "cloth_node": {**worn, "normals": args.normals},
    }
    refuse_doubly_said(choice, own, args)
    if choice.single["cloth_node"].get("step_on", "poses") != "poses":
        raise ParameterError("--set cloth_node.step_on", "found 'timer'", "allowed: poses")
    return {
        node: {
            **preset_values(choice.preset, node, solver=choice.solver),
            **options,
            **choice.single[node],
        }
        for node, options in own.items()
    }


def _namespace(name: str | None) -> str | None:
    return None if name is None else "/" * bool(name.strip("/")) + name.strip("/")


def _check_out(out: Path) -> None:
    """Refuse to replace what is no recording."""
    if out.exists() and not (
        out.is_dir() and ((out / "metadata.yaml").exists() or not any(out.iterdir()))
    ):
        raise InputFileError(
            f"--out {out}", "exists and is no recording", "allowed: a new name, or a recording"
        )


def _spread(tasks: list[_Task], args: argparse.Namespace) -> list[dict[str, Any]]:
    """Simulate elsewhere; what is whole stays, whatever becomes of the others.

    Raises:
        GarmentSimError: Of the first input that cannot be used, once the others are done.
    """
    results: dict[int, dict[str, Any]] = {}
    failed: dict[int, GarmentSimError] = {}
    done = (
        over_machines(_simulated, tasks, args.scheduler)
        if args.scheduler
        else over_processes(_simulated, tasks, args.jobs)
    )
    try:
        with closing(done):
            for k, result in progress(done, "recordings", len(tasks)):
                if isinstance(result, GarmentSimError):
                    failed[k] = result
                else:
                    results[k] = result
    finally:
        # Who is still at work elsewhere sees that nobody waits any more.
        remove_staged(tasks[0].out.parent, tasks[0].mark)
    if failed:
        raise failed[min(failed)]
    return [results[k] for k in range(len(tasks))]


def _simulated(task: _Task, *, show: bool = False) -> dict[str, Any]:
    """Simulate one input; elsewhere where there are several."""
    recording = _offline()
    from garment_sim_ros.ros.offline.inputs import from_clip, opened_input
    from garment_sim_ros.ros.offline.setup import Setup, fingerprint
    from garment_sim_ros.ros.offline.unfinished import to_go_on_with

    began = time.monotonic()
    with ExitStack() as stack:
        setup = Setup.of(task.nodes, markers=task.markers)
        if task.option == "--clip":
            source: Input = from_clip(setup.player, task.seconds)
        else:
            source = stack.enter_context(
                opened_input(task.source, begins_with=task.begin_with, namespace=task.namespace)
            )
        worn = {"body": setup.collider.body, "outfit": setup.cloth.outfit}
        clip = setup.player.clip
        moved, _ = file_and_animation(clip)
        files = {"input": moved or task.source, **worn}
        setup = dataclasses.replace(
            setup,
            # Where the clip lay does not matter: what it moved is in the recording.
            player=dataclasses.replace(setup.player, clip=Path(moved).name + clip[len(moved) :]),
            begins_with=source.begins_with,
            files={option: fingerprint(file) for option, file in files.items() if file}
            | {"messages": str(source.count)},
        )
        told: dict[str, Any] = {"input": task.source, "out": str(task.out)}
        if task.resume and task.out.exists() and recording.told_setup(task.out) == setup.text:
            return {**told, "left": True}
        unfinished = None
        if task.resume:
            unfinished = stack.enter_context(to_go_on_with(task.out))
            stage = unfinished.folder
        else:
            stage = stack.enter_context(staged(task.out.parent, mark=task.mark))
        result = recording.record(
            source,
            setup,
            stage / task.out.name,
            task.source,
            _bar if show else partial(_while_there, stage),
            unfinished,
        )
    took = time.monotonic() - began
    return {
        **told,
        **dataclasses.asdict(result),
        "took_s": round(took, 2),
        "times_real_time": round(result.seconds / took, 2),
    }


def _while_there(stage: Path, messages: "Iterator[Message]", count: int) -> "Iterator[Message]":
    """Pass messages on as long as their place is there: who no longer waits takes it away.

    Raises:
        GarmentSimError: It has been taken away.
    """
    for number, message in enumerate(messages):
        if number % _LOOK == 0 and not stage.exists():
            raise GarmentSimError(f"--out {stage}: was taken away meanwhile")
        yield message


def _line(result: dict[str, Any]) -> str:
    if result.get("left"):
        return f"{result['out']}: is there already"
    rejected = sum(result["rejected"].values())
    return (
        f"{result['out']}: {result['frames']} frames, {result['seconds']:.2f} s in "
        f"{result['took_s']:.1f} s, {result['times_real_time']:.1f} times real time"
        + (f", from frame {result['gone_on_from']} on" if result["gone_on_from"] else "")
        + (f", {rejected} messages not used" if rejected else "")
    )
