"""One status of a diagnostic message."""

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue


def status(
    name: str,
    values: Iterable[tuple[str, object]],
    *,
    text: str = "",
    well: bool = True,
    stale: bool = False,
) -> DiagnosticStatus:
    """One status; numbers are written so that plotting tools read them."""
    level = DiagnosticStatus.OK if well else DiagnosticStatus.WARN
    return DiagnosticStatus(
        level=DiagnosticStatus.STALE if stale else level,
        name=name,
        message=text,
        values=[
            KeyValue(key=key, value=f"{value:.6g}" if isinstance(value, float) else str(value))
            for key, value in values
        ],
    )
