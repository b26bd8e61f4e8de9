"""Colours of forces, and perceptually even colours of a number, low to high: tables that are interpolated. Pure.

The latter are those of matplotlib: `viridis` (CC0) for values of one sign, `coolwarm` [Moreland2009] for signed ones.
"""

MAPS = {
    "plain": (
        (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141), (44, 114, 142),
        (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115), (94, 201, 98), (132,
        212, 75), (173, 220, 48), (216, 226, 25), (253, 231, 37),
    ),
    "signed": (
        (59, 76, 192), (78, 104, 216), (98, 130, 234), (119, 154, 247), (141, 176, 254), (163, 194, 254), (185,
        208, 249), (204, 217, 237), (221, 220, 220), (236, 211, 197), (245, 196, 172), (247, 176, 147), (244,
        152, 122), (235, 125, 98), (221, 95, 75), (202, 59, 55), (180, 4, 38),
    ),
}  # fmt: skip
"""Colours [r, g, b], 0 to 255, evenly from the lowest value to the highest."""

FORCES: dict[str, tuple[int, int, int]] = {
    "normal force": (214, 39, 40),
    "friction": (255, 127, 14),
    "reaction": (31, 119, 180),
    "reaction moment": (106, 81, 163),
    "cable tension": (0, 140, 140),
    "servo torque": (194, 24, 91),
    "load": (44, 140, 44),
    "weight": (110, 110, 110),
}
"""Colours of kinds of forces."""

OTHER = (110, 110, 110)
"""Colour of a kind that has none of its own."""


def force_colour(group: str) -> tuple[int, int, int]:
    """Return the colour of a group of forces: that of its kind, which its name begins with, before ` on `."""
    return FORCES.get(group.partition(" on ")[0], OTHER)
