"""Numbers that several places measure with."""

GRAVITY = 9.81
"""What bodies fall with [m/s^2]."""
FALL = (0.0, 0.0, -GRAVITY)
"""The same as a vector, z up."""
USUAL_STEP = 1 / 180
"""Step of the solvers where none is asked for [s]: three a frame at 60 Hz."""
PERSON_HEIGHT = 1.65
"""Height of the person that sizes of garments and gaps are given for [m]."""
