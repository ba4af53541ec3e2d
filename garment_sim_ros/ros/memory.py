"""Memory that is not needed any more goes back to the system."""

import ctypes
import gc


def give_back() -> None:
    """Let go of what holds itself in circles, and of what the C library keeps free.

    What nodes and garments hold is large, and is asked for in other sizes the next time: kept, it
    is in pieces, and a process grows by some of it in each round.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
