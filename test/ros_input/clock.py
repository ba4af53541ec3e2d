"""A clock that the test moves, in the place of a node's."""

from types import SimpleNamespace


class Clock:
    """A node as a ticker sees it: in real time, which is what the test says [ns]."""

    def __init__(self, time):
        self.time = time

    def now(self):
        return SimpleNamespace(nanoseconds=self.time)

    def get_clock(self):
        return self

    def get_parameter(self, name):
        return SimpleNamespace(value=False)
