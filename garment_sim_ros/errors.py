"""The one exception family of the package.

A message names the file or option, the value found and what is allowed, for example
``walk.bvh: joint 'Hips' has 7 channels; 0 to 6 are allowed``. It is one line of text that can be
printed, whatever names it quotes.
"""

_LONGEST = 4000
_LONGEST_PATH = 300


class GarmentSimError(Exception):
    """Base of all errors that this package raises on purpose.

    Args:
        message: What is wrong; quoted text that cannot be printed is escaped.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(message))

    def __reduce__(self) -> tuple[object, ...]:
        """Errors go from one process to another as they are, whatever they are made from."""
        return _made_again, (type(self), self.args, self.__dict__)


def _made_again(
    kind: type[GarmentSimError], args: tuple[object, ...], state: dict[str, object]
) -> GarmentSimError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class InputFileError(GarmentSimError):
    """A file is missing, unreadable or holds something that is not allowed.

    Args:
        path: The file as the user named it.
        problem: What is wrong, with the value found.
        allowed: What would have been accepted.
    """

    def __init__(self, path: object, problem: str, allowed: str = "") -> None:
        self.path = str(path)
        self.problem = problem
        self.allowed = allowed
        super().__init__(
            f"{_shortened(self.path, _LONGEST_PATH)}: {problem}"
            + (f"; {allowed}" if allowed else "")
        )


class ParameterError(GarmentSimError):
    """An option or parameter has a value outside its declared type or range.

    Args:
        name: The option's or parameter's name.
        problem: What is wrong, with the value found.
        allowed: What would have been accepted.
    """

    def __init__(self, name: str, problem: str, allowed: str = "") -> None:
        self.name = name
        self.problem = problem
        self.allowed = allowed
        super().__init__(f"{name}: {problem}" + (f"; {allowed}" if allowed else ""))


class GeometryError(GarmentSimError):
    """A mesh, skeleton or shape cannot be used as it is (degenerate, open, not finite)."""


class MessageError(GarmentSimError):
    """An incoming message is rejected; the receiver keeps its last good state.

    Args:
        reason: A short fixed key under which rejections are counted on ``/diagnostics``.
        detail: What was found and what is allowed.
    """

    def __init__(self, reason: str, detail: str) -> None:
        self.reason = reason
        super().__init__(f"{reason}: {detail}")


def one_line(text: object) -> str:
    """Text as one line that can be printed: line ends, control characters and the like escaped."""
    line = _shortened(str(text), _LONGEST)
    if line.isprintable():
        return line
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in line
    )


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]} ... ({len(text)} characters)"
