"""The end of a process in which threads may still be at work.

When Python ends it stops daemon threads the next time that they need the interpreter. One that
comes back from C++ then, such as from the middleware or the compiler, is stopped within functions
that must not be left so: C++ takes that for a fault and aborts the process, which ends with a
signal instead of its exit code.
"""

import os
import sys
import threading


def end_process(code: int) -> int:
    """Ends the process with an exit code, at once where daemon threads are at work.

    What Python does at its end is then left out: what is to be cleaned up has to be so by now.

    Args:
        code: The exit code.

    Returns:
        The code, where no such thread is left: the process ends as any other.
    """
    if any(t.daemon and t is not threading.main_thread() for t in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code
