"""Published body measurements, for any stature, sex and build.

Source of `_SURVEY`: Gordon et al., "2012 Anthropometric Survey of U.S. Army Personnel: Methods and
Summary Statistics" (ANSUR II), NATICK/TR-15/007, 2014: means and standard deviations, rounded.
"""

import numpy as np

_STATURE = (1628.0, 1756.0)  # women, men [mm]

# Women's mean and standard deviation, men's mean and standard deviation [mm].
_SURVEY = {
    "neck": (330, 19, 398, 26),
    "chest": (947, 83, 1059, 87),
    "waist": (861, 100, 941, 112),
    "buttock": (1021, 76, 1020, 77),
    "thigh": (616, 56, 625, 59),
    "lower_thigh": (395, 33, 412, 32),
    "calf": (374, 29, 392, 30),
    "ankle": (216, 14, 229, 15),
    "biceps_flexed": (306, 31, 358, 35),
    "forearm_flexed": (264, 19, 310, 22),
    "wrist": (155, 7, 176, 9),
}

# Tensed muscle is thicker than that of a hanging arm.
_RELAXED = {"biceps_flexed": ("upper_arm", 0.94), "forearm_flexed": ("forearm", 0.96)}


def deviation(build: float) -> float:
    """Standard deviations from the survey's mean girth that a build stands for.

    The middle build lies below the mean: the survey's average body mass index is 25.5 (women)
    and 27.6 (men), the middle build's about 22 and 24.

    Args:
        build: 0 (slim, 3rd percentile) to 1 (heavy, 93rd percentile).
    """
    return -1.9 + 1.4 * build + 2.0 * build**2


def girths(height: float, sex: float, build: float) -> dict[str, float]:
    """Circumferences [m] of a person; see `tables.LANDMARKS` for where they are taken.

    Args:
        height: Stature [m].
        sex: 0 for female to 1 for male.
        build: 0 for slim to 1 for heavy.
    """
    z = deviation(build)
    out = {}
    for name, (female, female_sd, male, male_sd) in _SURVEY.items():
        shares = ((female + z * female_sd) / _STATURE[0], (male + z * male_sd) / _STATURE[1])
        name, relaxed = _RELAXED.get(name, (name, 1.0))
        out[name] = float(height * relaxed * np.dot((1.0 - sex, sex), shares))
    return out
