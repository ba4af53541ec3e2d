"""Machine code is made or loaded as a whole, whatever interrupts the program meanwhile.

The compiler's library asks Python for what is on disk while it makes a kernel's machine code. What
a signal's handler raises there, such as `KeyboardInterrupt`, goes no further than that question:
the answer is taken for none, nothing is loaded, and a call of the kernel then jumps to address 0.
Handlers run in the main thread only, so another thread does the work and this one waits.
"""

import functools
import threading
from typing import Any

from numba.core.codegen import JitEngine


def load_uninterrupted() -> None:
    """From now on what interrupts the making of machine code is raised at its end."""
    plain = JitEngine.finalize_object

    @functools.wraps(plain)
    def finalize_object(self: Any) -> None:
        if threading.current_thread() is not threading.main_thread():
            return plain(self)
        raised: list[BaseException] = []
        ended = threading.Event()

        def work() -> None:
            try:
                plain(self)
            except BaseException as error:
                raised.append(error)
            finally:
                ended.set()

        threading.Thread(target=work).start()
        while not ended.is_set():
            try:
                ended.wait()
            except BaseException as error:
                raised.append(error)
        if raised:
            raise raised[0]

    JitEngine.finalize_object = finalize_object
