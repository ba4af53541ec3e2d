"""Compiling what a node's frames run, each scene once."""

import dataclasses
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, ClassVar

import numpy as np

from garment_sim_ros.colliders.fitting import METHODS
from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.garment.outfit_file import OutfitFile
from garment_sim_ros.params import ColliderOptions
from garment_sim_ros.sim.compile_ahead import compile_ahead
from garment_sim_ros.sim.model import Parameters
from garment_sim_ros.sim.warm_up import Features, Scene, warm_up


class Compiler:
    """Compiles for scenes and parameters before a frame needs it; all of a process share it.

    Args:
        solver: Name of the solver.
        also: Functions whose kernels are compiled, too.
    """

    _compiled: ClassVar[set[tuple[Any, ...]]] = set()
    _lock = threading.Lock()

    def __init__(self, solver: str, *also: Callable[[], None]) -> None:
        self._solver = solver
        self._also = also
        self._scene = Scene()
        self._thread: threading.Thread | None = None

    def compile(
        self,
        scene: Scene,
        parameters: Parameters,
        tell: Callable[[str], object] = lambda words: None,
    ) -> None:
        """See to it that nothing is left to compile for a scene, from now on the current one.

        Args:
            scene: What there is.
            parameters: Outer forces and settings.
            tell: Takes how far it is, in words.

        Raises:
            GarmentSimError: A scene that cannot be.
        """
        with self._lock:
            self._scene = scene
            key = self._key(scene, parameters)
            if key not in self._compiled:
                compile_ahead(scene, self._solver, parameters, tell, also=self._also)
                warm_up(scene, self._solver, parameters)
                for function in self._also:
                    function()
                self._compiled.add(key)

    def expect(self, scene: Scene, parameters: Parameters, tell: Callable[[str], object]) -> None:
        """`compile` for a scene that may come to be another one, and may not be possible."""
        with suppress(GarmentSimError):
            self.compile(scene, parameters, tell)

    def is_ready(self, parameters: Parameters) -> bool:
        """Whether nothing is left to compile for the current scene with other parameters."""
        return self._key(self._scene, parameters) in self._compiled

    def compile_for(self, parameters: Parameters) -> None:
        """Compile for the current scene with other parameters."""
        scene = self._scene
        try:
            self.compile(scene, parameters)
        except GarmentSimError:
            # Whoever gives these parameters to the simulation gets the same error.
            self._compiled.add(self._key(scene, parameters))

    def _key(self, scene: Scene, parameters: Parameters) -> tuple[Any, ...]:
        return self._solver, self._also, scene, _choice(parameters)

    def begin(self, parameters: Parameters) -> None:
        """`compile_for` beside the node's thread, unless it is at it."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(
                target=self.compile_for, args=(parameters,), daemon=True
            )
            self._thread.start()


def expected_scene(file: OutfitFile, usual: ColliderOptions | None = None) -> Scene:
    """What an outfit tells of its scene before there are a body and colliders.

    It is what the scene comes to be on a body of common shape: then nothing is left to compile.

    Args:
        file: The outfit.
        usual: Colliders where it says nothing of them; the defaults where None.
    """
    colliders = file.colliders_on(usual or ColliderOptions())
    return Scene(
        kinds=frozenset(METHODS[colliders.method].variants(colliders)),
        garments=frozenset(
            Features(
                # Where the file names none, they are most often in layers.
                layer=number if entry.layer is None else entry.layer,
                # Where nothing else is said, what hangs from the shoulders stays near to them.
                skin_limits=tuple(
                    sorted({*entry.holds.skin_limits, *_usual_limits(entry.generator)})
                ),
                tethers=entry.holds.tethers is not None,
                soft=bool(np.isfinite(entry.holds.stiffness)),
                pinned=not np.isfinite(entry.holds.stiffness),
                self_collision=entry.self_collision is not False,
                passed=True,  # by hands at least
            )
            for number, entry in enumerate(file.garments)
        ),
    )


def _usual_limits(generator: str | None) -> tuple[str, ...]:
    """Limits that a built-in garment has where the outfit names none."""
    return ("max_distance",) if generator == "tshirt" else ()


def _choice(parameters: Parameters) -> tuple[Any, ...]:
    """What of parameters can decide which code is run: words, and which numbers are 0 or 1."""
    groups = (parameters.environment, parameters.settings)
    values = [value for group in groups for value in dataclasses.asdict(group).values()]
    return tuple(
        value
        if isinstance(value, (str, bool))
        else (bool(np.any(np.asarray(value))), bool(np.all(np.asarray(value) == 1)))
        for value in values
    )
