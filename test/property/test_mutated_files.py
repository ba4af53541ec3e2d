"""Damaged files of every format: one clear error or a result, soon and in little memory."""

from hostile.apart import told_by

MUTANTS = 25
"""Of each format; `make fuzz` tries many more."""


def test_readers_of_damaged_files_end_with_one_clear_error():
    """In a process of its own, whose memory is limited and which a hanging reader ends."""
    found, code = told_by("hostile.run", "--mutants", str(MUTANTS), "--seed", "7")
    assert len(found) >= 36
    assert {name: result["failures"] for name, result in found.items() if result["failures"]} == {}
    assert code == 0
    # Damage that breaks everything or nothing would show little.
    assert sum(result["read"] for result in found.values()) > MUTANTS
    assert sum(result["refused"] for result in found.values()) > 10 * MUTANTS
