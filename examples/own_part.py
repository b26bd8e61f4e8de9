"""Writes a part as a CAD program does: a finger with notches as a STEP file, its faces named.

    python examples/own_part.py

It writes notched.step, in millimetres, 80 x 16 x 12 mm; the faces at its ends are `base` and `tip`.
"""

from pathlib import Path

import numpy as np

LENGTH, WIDTH, HEIGHT, NOTCHES = 80.0, 16.0, 12.0, 5  # [mm]
HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('mechanical design');
#2=PRODUCT_CONTEXT('',#1,'mechanical');
#3=PRODUCT('finger','finger','',(#2));
#4=PRODUCT_DEFINITION_FORMATION('','',#3);
#5=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#6=PRODUCT_DEFINITION('design','',#4,#5);
#7=PRODUCT_DEFINITION_SHAPE('','',#6);
#8=(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.));
#9=(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.));
#10=(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT());
#11=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-5),#8,'','');
#12=(GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#11))
GLOBAL_UNIT_ASSIGNED_CONTEXT((#8,#9,#10)) REPRESENTATION_CONTEXT('',''));"""


def outline() -> np.ndarray:
    """Return the side view of the finger, counter-clockwise, shape (k, 2) [mm]: notches from below."""
    below = [(0.0, 0.0)]
    for k in range(NOTCHES):
        middle = LENGTH * (k + 1) / (NOTCHES + 1)
        below += [
            (middle - 2.5, 0.0),
            (middle - 1.5, 0.5 * HEIGHT),
            (middle + 1.5, 0.5 * HEIGHT),
            (middle + 2.5, 0.0),
        ]
    return np.array([*below, (LENGTH, 0.0), (LENGTH, HEIGHT), (0.0, HEIGHT)])


def prism(sides: np.ndarray) -> tuple[np.ndarray, dict[str, list[int]]]:
    """Return the corners (2 k, 3) of an outline that is as wide as the finger, and its faces as loops of corners."""
    k = len(sides)
    points = np.array([[x, y, z] for y in (-0.5 * WIDTH, 0.5 * WIDTH) for x, z in sides.tolist()])
    faces = {"right": list(range(k)), "left": [k + i for i in reversed(range(k))]}
    for i in range(k):
        j = (i + 1) % k
        name = {k - 3: "tip", k - 2: "top", k - 1: "base"}.get(i, f"below_{i}")
        faces[name] = [j, i, i + k, j + k]
    return points, faces


def step_text(points: np.ndarray, faces: dict[str, list[int]]) -> str:
    """Return a STEP file of a solid with plane faces.

    Args:
        points: Its corners [mm], shape (n, 3).
        faces: Corners of each face in a loop, counter-clockwise seen from outside, by the face's name.
    """
    lines = HEADER.splitlines()
    number = 12

    def add(text: str) -> str:
        nonlocal number
        number += 1
        lines.append(f"#{number}={text};")
        return f"#{number}"

    def triple(kind: str, values: np.ndarray) -> str:
        return add(f"{kind}('',({','.join(f'{v:.12E}' for v in values)}))")

    corner = [triple("CARTESIAN_POINT", p) for p in points]
    vertex = [add(f"VERTEX_POINT('',{p})") for p in corner]
    curves = dict[tuple[int, int], str]()
    made = []
    for name, loop in faces.items():
        edges = []
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
            low, high = min(a, b), max(a, b)
            if (low, high) not in curves:
                way = add(f"VECTOR('',{triple('DIRECTION', points[high] - points[low])},1.)")
                line = add(f"LINE('',{corner[low]},{way})")
                curves[low, high] = add(f"EDGE_CURVE('',{vertex[low]},{vertex[high]},{line},.T.)")
            edges.append(add(f"ORIENTED_EDGE('',*,*,{curves[low, high]},{'.T.' if a < b else '.F.'})"))
        loop_of_edges = add(f"EDGE_LOOP('',({','.join(edges)}))")
        bound = add(f"FACE_OUTER_BOUND('',{loop_of_edges},.T.)")
        x = points[loop]
        normal = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)
        axes = f"{triple('DIRECTION', normal)},{triple('DIRECTION', x[1] - x[0])}"
        place = add(f"AXIS2_PLACEMENT_3D('',{corner[loop[0]]},{axes})")
        plane = add(f"PLANE('',{place})")
        made.append(add(f"ADVANCED_FACE('{name}',({bound}),{plane},.T.)"))
    shell = add(f"CLOSED_SHELL('',({','.join(made)}))")
    solid = add(f"MANIFOLD_SOLID_BREP('',{shell})")
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({solid}),#12)")
    add(f"SHAPE_DEFINITION_REPRESENTATION(#7,{shape})")
    return "\n".join([*lines, "ENDSEC;", "END-ISO-10303-21;", ""])


if __name__ == "__main__":
    points, faces = prism(outline())
    Path("notched.step").write_text(step_text(points, faces))
    print(f"notched.step: {len(faces)} faces, {np.ptp(points[:, 0]):.0f} mm long")
