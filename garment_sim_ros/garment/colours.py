"""Colours of garments, the same on topics and in pictures."""

Colour = tuple[float, float, float]

_COLOURS = ("2f7f8c", "d4654c", "d9a441", "6b5b95", "5b8c5a")


def garment_colour(number: int) -> Colour:
    """Red, green and blue, as screens take them, of the garment at a place in its outfit.

    Args:
        number: 0 for the first; inner ones come before outer ones.
    """
    r, g, b = bytes.fromhex(_COLOURS[number % len(_COLOURS)])
    return r / 255.0, g / 255.0, b / 255.0
