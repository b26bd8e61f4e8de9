"""Colours by which bodies of one kind are told apart. Pure."""

Rgb = tuple[int, int, int]

SHADES = (1.0, 0.7, 1.2, 0.85)
"""Times the colour of their kind, of one body after the other."""


def shade(colour: Rgb, number: int) -> Rgb:
    """Return the colour of body `number` of a kind that has `colour`: body 0 has it itself."""
    red, green, blue = (min(round(SHADES[number % len(SHADES)] * part), 255) for part in colour)
    return red, green, blue
