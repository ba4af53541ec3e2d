"""What a soak run finds: one row a figure."""

from dataclasses import dataclass

_WIDTHS = (16, 46, 18, 18)


@dataclass(frozen=True, kw_only=True)
class Lengths:
    """How long each fault is kept up.

    Attributes:
        minutes: Of the flood.
        hours: Of simulated time.
        hour: Length of one of these [s].
        rate: Joint states a second of it, each of which a frame of cloth is made of.
        preset: Of the cloth in it.
        rounds: Of configuring and cleaning up, for each node.
        kills: Of each node.
        jumps: Of the clock.
        longest: Real time that one fault may take [s]; what it came to by then is told.
    """

    minutes: float
    hours: int
    hour: float
    rate: int = 60
    preset: str = "balanced"
    rounds: int
    kills: int
    jumps: int
    longest: float


SHORT = Lengths(minutes=1.0, hours=2, hour=60.0, rounds=60, kills=1, jumps=10, longest=180.0)
FULL = Lengths(
    minutes=5.0, hours=8, hour=3600.0, rounds=1000, kills=5, jumps=100, longest=8 * 3600.0
)


@dataclass(frozen=True)
class Row:
    """One figure.

    Attributes:
        what: Of what.
        found: As measured.
        limit: What is allowed; empty where it is only told.
        holds: Whether it is.
    """

    what: str
    found: str
    limit: str = ""
    holds: bool = True


def at_most(what: str, found: float, limit: float, unit: str = "") -> Row:
    """A figure that may not be larger than its limit."""
    return Row(what, f"{found:.4g} {unit}", f"at most {limit:g} {unit}", found <= limit)


def at_least(what: str, found: float, limit: float, unit: str = "") -> Row:
    """A figure that may not be smaller than its limit."""
    return Row(what, f"{found:.4g} {unit}", f"at least {limit:g} {unit}", found >= limit)


def line(*cells: str) -> str:
    """A line of the table."""
    return "  ".join(f"{cell:<{width}}" for cell, width in zip(cells, _WIDTHS)).rstrip()


def row_line(fault: str, row: Row) -> str:
    """A row of the table."""
    return line(fault, row.what, row.found, row.limit) + ("" if row.holds else "  FAILED")
