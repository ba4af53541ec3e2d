"""Work on machines that a scheduler of dask.distributed knows."""

import logging
from asyncio import CancelledError
from collections.abc import Callable, Generator, Sequence
from typing import TypeVar

from garment_sim_ros.errors import GarmentSimError, ParameterError

Task = TypeVar("Task")
Result = TypeVar("Result")

_PATIENCE = 10.0
"""For the scheduler, and for its first worker, to answer [s]."""
_OPTION = "--scheduler"
_KEPT = "what is whole stays, --resume does the others"


def over_machines(
    call: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Generator[tuple[int, Result | GarmentSimError], None, None]:
    """Call a function for each task on a worker of a scheduler.

    A task whose worker is lost is given to another one, as often as the scheduler allows.

    Args:
        call: A function of a module that workers have, too.
        tasks: What it is called with.
        address: Of the scheduler, tcp://HOST:PORT.

    Yields:
        A task's place and what came of it, as they come. To be closed: what has not begun by then
        does not begin.

    Raises:
        GarmentSimError: The scheduler or its workers cannot be used, or are lost.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise GarmentSimError(
            f"{_OPTION}: {error}; pip install 'garment_sim_ros[machines]'"
        ) from None
    # It tells on stderr what is told here in one line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise ParameterError(
            _OPTION, f"found {address!r} ({error})", "allowed: tcp://HOST:PORT of a scheduler"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            raise ParameterError(
                f"{_OPTION} {address}", "has no workers", f"allowed: dask worker {address}"
            ) from None
        waiting = {client.submit(call, task, pure=False): k for k, task in enumerate(tasks)}
        try:
            for future in as_completed(waiting, loop=client.loop):
                try:
                    result: Result | GarmentSimError = future.result()
                except GarmentSimError as error:
                    result = error
                yield waiting[future], result
        except CancelledError:
            raise GarmentSimError(f"{_OPTION} {address}: is lost; {_KEPT}") from None
        except (GeneratorExit, KeyboardInterrupt):
            raise
        except BaseException as error:
            # Of a worker: whatever it lacks, or that too many were lost with the same task.
            said = f"{type(error).__name__}: {error}"
            raise GarmentSimError(f"{_OPTION}: a worker cannot do it ({said}); {_KEPT}") from None
        finally:
            client.cancel(list(waiting))
