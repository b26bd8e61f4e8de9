"""Draw the way of a scene through the rooms of the simulator, an SVG: `python docs/step_picture.py`."""

from html import escape
from pathlib import Path

PICTURE = Path(__file__).parent / "images" / "step.svg"

ROOMS = (
    ("scene file", "scenes/tripod.toml", ("scene.load_scene",)),
    ("scene", "tables with units and ranges", ("scene.Scene", "scene.checks")),
    ("model", "mesh, groups, terms", ("scene.lowering.lowered", "model.Model", "build.build_model")),
    ("system", "sum of terms Φ(x)", ("system.System", "forces.term.Term")),
    ("time scheme", "stages of a step", ("integrators.implicit.ImplicitSteps",)),
    ("minimise", "Newton with line search", ("integrators.minimise.minimise",)),
    ("contact", "gaps ≥ 0, friction", ("contact.contact_solver.ContactSolver",)),
    ("state", "x, v, t", ("state.State",)),
    ("message", "topics of the node", ("tripod_runtime.node",)),
)
"""Title, what is in it, and names of the code that does it, below `tripod_sim` if no package is named."""

WIDTH, HEIGHT, GAP, ACROSS = 256, 92, 34, 3

LOOP = (4, 7)
"""The first and last room that every step passes."""


def svg() -> str:
    """Return the picture as SVG, three rooms in a row; those of the loop are coloured."""
    rows = -(-len(ROOMS) // ACROSS)
    wide, high = ACROSS * (WIDTH + GAP) + GAP, rows * (HEIGHT + GAP) + GAP
    made = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" font-family="sans-serif">',
        '<defs><marker id="tip" markerWidth="8" markerHeight="8" refX="7" refY="4" orient="auto">'
        '<path d="M0 0 8 4 0 8z" fill="#666"/></marker></defs>',
        f'<rect width="{wide}" height="{high}" fill="#fff"/>',
    ]
    for i, (title, what, names) in enumerate(ROOMS):
        x, y = _corner(i)
        fill = "#fdf0d5" if LOOP[0] <= i <= LOOP[1] else "#e8eef7"
        made.append(
            f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="6" fill="{fill}" stroke="#666"/>'
        )
        made.append(_text(x, y + 22, title, 'font-size="15" font-weight="bold"'))
        made.append(_text(x, y + 40, what, 'font-size="12"'))
        made += [
            _text(x, y + 60 + 17 * k, name, 'font-size="11" font-family="monospace"')
            for k, name in enumerate(names)
        ]
        if i:
            made.append(_arrow(i - 1, i))
    return "\n".join([*made, "</svg>", ""])


def _corner(i: int) -> tuple[int, int]:
    """Return the upper left corner of a room."""
    row, column = divmod(i, ACROSS)
    return GAP + column * (WIDTH + GAP), GAP + row * (HEIGHT + GAP)


def _text(x: int, y: int, text: str, style: str) -> str:
    """Return a line in the middle of the room whose left side is at x."""
    return f'<text x="{x + WIDTH // 2}" y="{y}" text-anchor="middle" {style}>{escape(text)}</text>'


def _arrow(i: int, j: int) -> str:
    """Return the arrow from one room to the next: to the right, or from the end of a row to the next one."""
    (a, b), (c, d) = _corner(i), _corner(j)
    if b == d:
        path = f"M{a + WIDTH} {b + HEIGHT // 2}H{c - 2}"
    else:
        path = f"M{a + WIDTH // 2} {b + HEIGHT}V{b + HEIGHT + GAP // 2}H{c + WIDTH // 2}V{d - 2}"
    return f'<path d="{path}" fill="none" stroke="#666" marker-end="url(#tip)"/>'


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
