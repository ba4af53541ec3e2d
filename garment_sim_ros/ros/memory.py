"""Memory that is not needed any more goes back to the system."""

import ctypes
import gc

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
"""Options of `mallopt`, as `malloc.h` of the GNU C library numbers them."""
_LARGE = 128 * 1024
"""Blocks from this size on stand alone [bytes]: the library's own start value, which it raises to
32 MiB as blocks are freed."""
_ARENAS = 2
"""Heaps that threads share; eight for each core otherwise."""


def keep_in_few_pieces() -> None:
    """Have the C library keep large arrays apart and use few heaps; before other threads begin.

    Else arrays of megabytes lie between small blocks, in a heap for each thread: the more
    threads are at work at once, the more of it stays in pieces that nothing fits into.
    """
    options = getattr(ctypes.CDLL(None), "mallopt", None)
    if options is not None:
        options(_M_MMAP_THRESHOLD, _LARGE)
        options(_M_ARENA_MAX, _ARENAS)


def give_back() -> None:
    """Let go of what holds itself in circles, and of what the C library keeps free.

    What nodes and garments hold is large, and is asked for in other sizes the next time: kept, it
    is in pieces, and a process grows by some of it in each round.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
