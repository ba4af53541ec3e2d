"""`cloth_node`: collider poses in, moving garments out, at a fixed rate."""

import math
import sys
import time
from dataclasses import replace
from threading import Thread
from typing import Any

from std_srvs.srv import SetBool, Trigger

from garment_sim_ros.body.loaders.load import load_body
from garment_sim_ros.body.missing_bones import missing_bones_of
from garment_sim_ros.colliders.description import MAX_TEXT
from garment_sim_ros.errors import MessageError, ParameterError
from garment_sim_ros.garment.outfit_file import DEFAULT_OUTFIT, read_outfit
from garment_sim_ros.params import ClothNodeParameters, Environment
from garment_sim_ros.presets import usual_colliders
from garment_sim_ros.ros.cloth_frames import ClothFrames
from garment_sim_ros.ros.cloth_stepper import POSE_COUNT, ClothStepper
from garment_sim_ros.ros.compiler import Compiler, expected_scene
from garment_sim_ros.ros.conversions import StampedPoses, poses_from, text_from
from garment_sim_ros.ros.diagnostics import Condition
from garment_sim_ros.ros.dresser import Dressed, Dresser
from garment_sim_ros.ros.garment_publishers import warm_up
from garment_sim_ros.ros.lifecycle import ManagedNode
from garment_sim_ros.ros.overload import Overload
from garment_sim_ros.ros.pace import Pace, check_pace, moves
from garment_sim_ros.ros.place import ALONE, Place
from garment_sim_ros.ros.process import run
from garment_sim_ros.ros.progress import reporting
from garment_sim_ros.ros.rclpy_internals import PARTICIPANT, Taken
from garment_sim_ros.ros.shared import shared
from garment_sim_ros.ros.sources import OTHER_PUBLISHER, Source
from garment_sim_ros.ros.topics import COLLIDER_DESCRIPTION, COLLIDER_POSES
from garment_sim_ros.sim.account import account, in_words
from garment_sim_ros.sim.health import totals
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.solvers import SOLVERS
from garment_sim_ros.sim.world.wind_field import check_wind
from garment_sim_ros.stamps import SECOND

_FASTEST_INPUT = 1000.0
"""Poses may come this often without any being lost between two frames [Hz]."""
_GAP = SECOND // 4
"""Without poses for so long the node is not to blame for what it passes over [ns]."""
_MOST_DESCRIBED = 4
"""Processes whose descriptions are kept, for the case that their poses are followed."""
_WAIT = 0.1
"""Between two looks whether the node is to end [s]."""
_MOST_EARLY_POSES = 10_000
"""Messages kept, with `step_on` poses, until the description is there."""


class ClothNode(ManagedNode[ClothNodeParameters]):
    """Simulates an outfit on colliders that others pose.

    Attributes:
        shown: What it publishes.
    """

    def __init__(self, place: Place = ALONE) -> None:
        super().__init__("cloth_node", ClothNodeParameters, place)
        self.realtime_priority = self.parameters.realtime_priority
        self._environment = self.declare(
            Environment,
            check=lambda environment: self._try(environment, self._settings.values),
            on_change=self._change_forces,
        )
        self._settings = self.declare(
            SOLVERS[self.parameters.solver].settings,
            check=lambda settings: self._try(self._environment.values, settings),
            on_change=self._change_forces,
        )
        self._stepper: ClothStepper | None = None
        self._early: list[StampedPoses] = []
        self._still_dressing: Thread | None = None
        self._paused = self._forces_are_new = False
        self._moved_ahead, self._spent = False, 0.0
        self._overload = Overload(self.get_logger().warning)
        self.shown = ClothFrames(self)
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(SetBool, "~/pause", self._pause)

    def prepare(self) -> None:
        """Load body and outfit, compile.

        Raises:
            InputFileError: A file cannot be used.
            ParameterError: A parameter is not allowed.
        """
        p = self.parameters
        check_pace(self.preset, self._settings.values, p)
        if not p.body:
            raise ParameterError("body", "found nothing", "allowed: the wearer's file")
        outfit = p.outfit or DEFAULT_OUTFIT
        file = read_outfit(outfit)
        compiler = Compiler(p.solver, warm_up)
        with reporting(self.get_logger().info, "compile, or load what is compiled") as tell:
            check_wind(self._environment.values)
            # The description may tell of other colliders than the outfit asks for.
            usual = usual_colliders(self.preset)
            compiler.expect(expected_scene(file, usual), self._forces(), tell)
        # Last: by now `collider_node` may have left it in the cache.
        with reporting(self.get_logger().info, f"load the body {p.body}"):
            body = shared(load_body, p.body, bone_names=p.body_bone_names)
            body = replace(body, skinning=p.skinning)
        if missing := missing_bones_of(body, "body_bone_names"):
            self.get_logger().warning(missing)
        self._dresser = Dresser(
            outfit,
            body,
            frame_id=p.frame_id,
            attachments=p.attachments,
            solver=p.solver,
            solver_step=p.solver_step,
            detail=p.detail,
            paced=moves(self.preset, p),
            compiler=compiler,
            parameters=self._forces,
            after=self._still_dressing,
        )
        self._compiler = compiler
        self._steps_on_poses = p.step_on == "poses"
        self.shown.advertise()
        self._described: dict[bytes, str] = {}
        self._worn_from: bytes | None = None
        self._source = Source(p.stale_after)
        self.take_in(COLLIDER_DESCRIPTION, self._take_description, always=True)
        self._poses = self.take_in(
            COLLIDER_POSES,
            self._take_poses,
            source=self._source,
            keep_all=self._steps_on_poses,
            room=0 if self._steps_on_poses else math.ceil(2.0 * _FASTEST_INPUT / p.rate),
        )

    def start(self) -> None:
        """Begin to publish as soon as there are poses."""
        self._moved_ahead, self._spent = False, 0.0
        if not self._steps_on_poses:
            self._ticker = self.tick_at(self.parameters.rate, self._tick, self._work_ahead)

    def stop(self) -> None:
        """Publish nothing; the cloth keeps its state."""
        if not self._steps_on_poses:
            self.stop_ticking()

    def release(self) -> None:
        """Take off the outfit."""
        self.shown.release()
        self._early, self._stepper = [], None
        if hasattr(self, "_dresser"):  # else configuring failed before
            self._still_dressing = self._dresser.retire()
            del self._dresser

    def parameters_changed(self, parameters: ClothNodeParameters) -> None:
        """Take over another delay or budget."""
        if self._stepper is not None:
            self._stepper.delay = parameters.delay
            self._pace.take(parameters)

    def _try(self, environment: Environment, settings: Any) -> None:
        """See whether values suit each other and the colliders.

        Raises:
            ParameterError: They do not.
        """
        check_wind(environment)
        check_pace(self.preset, settings, self.parameters)
        if self._stepper is not None:
            self._stepper.simulation.check(Parameters(environment=environment, settings=settings))

    def _change_forces(self, _: object) -> None:
        self._forces_are_new = True
        if self._stepper is not None and self._steps_on_poses:
            # Which poses meet which forces must not depend on how fast this machine compiles.
            self._compiler.compile_for(self._forces())
            self._take_over_forces()
        self.tell_idle()

    def _take_over_forces(self) -> None:
        """Simulate with the forces that were set, once what they run is compiled."""
        if self._stepper is None or not self._forces_are_new:
            return
        forces = self._forces()
        if not self._compiler.is_ready(forces):
            self._compiler.begin(forces)
            return
        self._forces_are_new = False
        try:
            self._stepper.simulation.parameters = forces
            self._pace.apply()
        except ParameterError as error:
            self.get_logger().warning(f"the new parameters are not used: {error}")

    def _forces(self) -> Parameters:
        return Parameters(environment=self._environment.values, settings=self._settings.values)

    @property
    def has_description(self) -> bool:
        """Whether garments are on colliders."""
        return self._stepper is not None

    def condition(self) -> Condition:
        """What the node waits for, or how it keeps up."""
        stepper = self._stepper
        if self.state != "active" or stepper is None or not stepper.has_poses:
            missing = COLLIDER_DESCRIPTION if stepper is None else COLLIDER_POSES
            text = f"waits for {missing.name}" if self.state == "active" else self.state
            return Condition(text=text, well=self.state != "active")
        health = [stepper.simulation.health(name) for name in stepper.simulation.names]
        silent = self._poses.silent()
        stale = silent > self.parameters.stale_after
        lost = self._overload.look(stepper.coarse, stepper.skipped, time.monotonic_ns())
        text = "paused" if self._paused else "simulates"
        if stale:
            text = f"no usable {COLLIDER_POSES.name} for {silent:.1f} s"
        return Condition(
            text=f"{text}; {lost}" if lost else text,
            well=not lost,
            stale=stale,
            values={
                "input_age_s": silent,
                **self.shown.figures(),
                **stepper.figures(),
                **totals(health),
                "outran_cloth": stepper.simulation.outran,
                **self._pace.figures(),
            },
        )

    def attend(self) -> None:
        """Take over garments that have been made."""
        if self.state != "active" or self._steps_on_poses:
            return
        try:
            self._put_on(self._dresser.result())
        except MessageError as error:
            self.reject(COLLIDER_DESCRIPTION.name, error)
        if self._ticker.stands_still():
            self.take_inputs()
            stepper = self._stepper
            if stepper and stepper.has_poses and stepper.due(stepper.newest) > 0:
                # Poses that came after the last tick of a clock that was paused, or steps.
                self._tick(self._ticker.now(), 1)

    def _take_description(self, message: Taken) -> None:
        sender = message.publisher[:PARTICIPANT]
        self._described.pop(sender, None)
        self._described[sender] = text_from(message.data, MAX_TEXT)
        if len(self._described) > _MOST_DESCRIBED:
            del self._described[next(iter(self._described))]
        followed = (self._source.followed or b"")[:PARTICIPANT]
        if self._source.is_held(time.monotonic_ns()) and sender != followed == self._worn_from:
            raise MessageError(OTHER_PUBLISHER, "kept until the poses of its publisher are used")
        self._dress(sender)

    def _dress(self, sender: bytes) -> None:
        """Have the garments made for what a process described."""
        self._worn_from = sender
        self._dresser.request(self._described[sender])
        if self._steps_on_poses:
            # Which poses meet which description must not depend on how fast this machine is.
            while self._dresser.busy and self.context.ok():
                self._put_on(self._dresser.result(longest=_WAIT))
            early, self._early = self._early, []
            for message in early:
                try:
                    self._step_to(message)
                except MessageError as error:
                    self.rejections.add(COLLIDER_POSES.name, error)

    def _put_on(self, dressed: Dressed | None) -> None:
        if dressed is None:
            return
        p, simulation = self.parameters, dressed.simulation
        try:
            simulation.parameters = self._forces()
        except ParameterError as error:  # set while the garments were made
            raise MessageError(COLLIDER_DESCRIPTION.name, str(error)) from error
        self._stepper = ClothStepper.with_parameters(simulation, p)
        self._pace = Pace(self._stepper, p, self.preset, self.get_logger().info)
        for line in (*in_words(account(simulation)), *dressed.notes):
            self.get_logger().info(line)
        self.shown.show(dressed, p)

    def _take_poses(self, taken: Taken) -> None:
        message = poses_from(taken.data)
        expected = self.parameters.frame_id
        if message.frame_id != expected:
            raise MessageError("frame_id", f"found {message.frame_id!r}; allowed: {expected!r}")
        sender = taken.publisher[:PARTICIPANT]
        if sender in self._described and sender != self._worn_from:
            self._dress(sender)
        if self._stepper is None:
            if self._steps_on_poses and len(self._early) < _MOST_EARLY_POSES:
                self._early.append(message)
            return
        gap = self._stepper.has_poses and message.stamp > self._stepper.newest + _GAP
        if gap and not self._poses.away:  # else they came while the node did not look
            self._overload.excuse(time.monotonic_ns())
        new_sender = self._source.followed not in (None, taken.publisher)
        if self._steps_on_poses:
            self._step_to(message, new_sender=new_sender)
            return
        try:
            arrival = self._ticker.steady() - (0 if self._ticker.is_simulated else taken.age())
            self._stepper.add(message.stamp, message.poses, arrival, new_sender=new_sender)
        except MessageError as error:
            # Poses of colliders that the garments are being made for are no fault.
            if error.reason != POSE_COUNT or not self._dresser.busy:
                raise

    def _step_to(self, message: StampedPoses, *, new_sender: bool = False) -> None:
        """Advance by whole steps up to a message; publish what moved."""
        stepper = self._stepper
        assert stepper is not None
        stepper.add(message.stamp, message.poses, message.stamp, new_sender=new_sender)
        if not self._paused and self._advance(message.stamp, in_time=False):
            self._publish()

    def _tick(self, due: int, ticks: int) -> None:
        """Publish a frame, of the last good state where there is no other.

        Where poses have been missing for long only what moved is published.
        """
        self.take_inputs()
        stepper = self._stepper
        if stepper is None or not stepper.has_poses:
            return
        self._pace.wait(self._ticker, due)
        self._pace.begin()
        self._take_over_forces()
        self.shown.late.begin(due, self._ticker.period, ticks - 1 if self.shown.count else 0)
        moved, self._moved_ahead = self._moved_ahead, False
        if not self._paused:
            is_over = self._ticker.stands_still()
            until = stepper.newest if is_over else stepper.target(self._ticker.steady())
            moved = self._advance_in_time(until) or moved
        if moved or self._poses.silent() <= self.parameters.stale_after:
            self._publish()
        self._pace.end(moved=moved)

    def _work_ahead(self, due: int) -> None:
        """Simulate what is due in the next frame, as far as the poses for it are there."""
        self.take_inputs()
        stepper, ticker = self._stepper, self._ticker
        if stepper is None or self._paused:
            return
        until = stepper.ahead(ticker.steady() + due - ticker.now())
        if until is None:
            return
        self._pace.begin()
        self._take_over_forces()
        self._moved_ahead = self._advance_in_time(until) or self._moved_ahead
        self._pace.rest(ticker)

    def _advance_in_time(self, until: int) -> bool:
        try:
            return self._advance(self._pace.look(until), in_time=True)
        except MessageError as error:
            self.rejections.add(COLLIDER_POSES.name, error)
            return False

    def _advance(self, until: int, *, in_time: bool) -> bool:
        assert self._stepper is not None
        began = time.perf_counter()
        moved = self._stepper.advance(until, in_time=in_time)
        self._spent += 1e3 * (time.perf_counter() - began)
        return moved

    def _publish(self) -> None:
        self.shown.step_ms, self._spent = self._spent, 0.0
        if self._stepper is not None:
            self.shown.publish(self._stepper, self._pace.figures())

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._stepper is not None and self._stepper.has_poses
        response.message = "there are no poses yet"
        if response.success and self._stepper is not None:
            self._stepper.restart()
            response.message = "the garments are put on again"
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = bool(request.data)
        self._overload.excuse(time.monotonic_ns())
        response.success = True
        response.message = "the cloth stands still" if self._paused else "the cloth moves"
        return response


def main(argv: list[str] | None = None) -> int:
    """Entry point of the executable."""
    return run("cloth_node", ClothNode, argv)


if __name__ == "__main__":
    sys.exit(main())
