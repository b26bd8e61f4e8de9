"""The colours of a field in pictures that no browser draws, and their legend. Pure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.player.colour_maps import MAPS
from tripod_view.player.film import Film

NONE = (176.0, 176.0, 176.0)
"""Colour where there is no value, the player's."""

BAR = (192, 10)
"""Columns and rows of the bar in a legend."""

ROUNDING = 1e-9
"""Of a limit over the range, the player's."""

PAPER, INK = 255, 40


@dataclass(frozen=True)
class ColourScale:
    """Colours of a field.

    Attributes:
        name: Of the field.
        unit: In the legend.
        low, high: Values of the first and last colour.
        table: Colours from low to high, shape (n, 3), 0 to 255.
        factor: From values to `unit`.
    """

    name: str
    unit: str
    low: float
    high: float
    table: FloatArray
    factor: float = 1.0

    def colours(self, values: FloatArray) -> FloatArray:
        """Return the colours of values, shape (n, 3); values beyond the limits have the last colour."""
        span = self.high - self.low
        share = (
            np.clip((values - self.low) / span, 0, 1)
            if span > 0
            else np.where(np.isfinite(values), 0.0, np.nan)
        )
        steps = np.linspace(0, 1, len(self.table))
        found = np.stack([np.interp(share, steps, column) for column in self.table.T], axis=1)
        found[~np.isfinite(values)] = NONE
        return found

    def _number(self, value: float) -> str:
        """Return a limit with three digits, as the player writes it; rounding beside the range is 0."""
        shown = self.factor * value if abs(value) > ROUNDING * (self.high - self.low) else 0.0
        return np.format_float_positional(float(f"{shown:.3g}"), trim="-")

    def legend(self) -> NDArray[np.uint8]:
        """Return a picture of the bar with name, unit and limits, shape (rows, columns, 3)."""
        from PIL import Image, ImageDraw, ImageFont  # noqa: PLC0415 - only for a legend

        columns, rows = BAR
        values = np.linspace(self.low, self.high, columns)
        image = Image.new("RGB", (columns + 12, rows + 40), (PAPER,) * 3)
        draw, font = ImageDraw.Draw(image), ImageFont.load_default(12)
        bar = np.rint(np.broadcast_to(self.colours(values), (rows, columns, 3))).astype(np.uint8)
        image.paste(Image.fromarray(bar), (6, 20))
        ink = (INK,) * 3
        draw.text((6, 3), f"{self.name} [{self.unit}]" if self.unit else self.name, ink, font)
        draw.text((6, 22 + rows), self._number(self.low), ink, font)
        draw.text((6 + columns, 22 + rows), self._number(self.high), ink, font, anchor="ra")
        return np.asarray(image)


def scale_of(film: Film) -> ColourScale | None:
    """Return the colours of a film, the same in all its pictures; None where it has its own colours."""
    chosen = film.colouring
    field = film.field(chosen.name) if chosen else None
    if not (chosen and field):
        return None
    low, high = chosen.limits or film.limits(chosen.name)
    factor, unit = (1e3, "mm") if field.unit == "m" else (1.0, field.unit)
    table = np.array(MAPS["signed" if field.signed else "plain"], float)
    return ColourScale(chosen.name, unit, low, high, table, factor)
