"""MuJoCo in the cases of `peers.py`: flex with continuum elasticity, and springs as spatial tendons.

Set as its manual advises for deformables: integrator `discrete` (implicit in position), solver Newton, tolerance 1e-6,
steps of 1 to 10 ms; contacts are off. RK4 and Euler, explicit, stand beside it. Bars: linear tetrahedra (`full`), and
cells of 27 nodes (`quadratic`), which the manual names against locking; the Y: tetrahedra, and a shell (2D flex), which
it recommends for thin plates. Vertices and nodes carry the lumped masses of the finite elements, as ours do. The ways
to rest are damped in proportion to mass.
"""

from collections.abc import Sequence
from importlib import metadata

import mujoco
import numpy as np

from benchmarks import peers_cases as cases
from benchmarks.blocks import lumped
from benchmarks.peers_cases import Prepared, Setting, height
from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.mesh.y_piece import YLevel, y_piece

NAME, MODULE = "MuJoCo", "mujoco"

STIFF = 1e4
"""Of the hinges that turn the ends in L2 [N m/rad]: at 0.5 N m they yield by 5e-5 rad."""


SHELLS = {
    "coarse": YLevel(4, 1, 8, 1.5, clamped=4, clamped_grading=2.0),
    "fine": YLevel(6, 2, 14, 1.3, clamped=5, clamped_grading=2.0),
}
"""Meshes of the shell. Its hinges bend over half an element into the clamp, so elements there must be small."""


def version() -> str:
    """Return MuJoCo's version."""
    return metadata.version("mujoco")


def _set(name: str, dt: float, *, quick: bool = False, integrator: str = "discrete", **options) -> Setting:
    solver = ", Newton, tolerance 1e-6" if integrator == "discrete" else ""
    return Setting(
        f"{name}, {integrator}{solver}, dt {1e3 * dt:g} ms",
        {"dt": dt, "integrator": integrator, **options},
        quick,
    )


def _full(cells: tuple[int, int, int], dt: float, **options) -> Setting:
    return _set(
        f"full (T4), {cells[0]} x {cells[1]} x {cells[2]} cells", dt, kind="full", cells=cells, **options
    )


def _quadratic(cells: int, dt: float, **options) -> Setting:
    return _set(f"quadratic, {cells} x 1 x 1 cells", dt, kind="quadratic", cells=(cells, 1, 1), **options)


SETTINGS = {
    "cantilever rest": [
        _quadratic(2, 0.01), _quadratic(4, 0.01, quick=True), _quadratic(8, 0.01), _full((10, 2, 2), 0.01),
        _full((20, 4, 4), 0.01),
    ],
    "cantilever swing": [
        _quadratic(4, 5e-3, quick=True), _quadratic(4, 1e-3), _quadratic(8, 5e-4), _full((20, 4, 4), 2e-3),
        _quadratic(2, 5e-4, integrator="RK4"), _quadratic(4, 2e-4, integrator="RK4"),
        _quadratic(8, 1e-4, integrator="RK4"),
    ],
    "y L1": [
        _set("shell, coarse", 0.01, kind="shell", level="coarse", quick=True),
        _set("shell, fine", 0.01, kind="shell", level="fine"),
        _set("full (T4), mesh level 5", 0.01, kind="full", level=5),
        _set("full (T4), mesh level 6", 0.01, kind="full", level=6),
    ],
    "y L2": [
        _set("shell, coarse", 5e-3, kind="shell", level="coarse", quick=True),
        _set("shell, fine", 5e-3, kind="shell", level="fine"),
        _set("full (T4), mesh level 5", 5e-3, kind="full", level=5),
        _set("full (T4), mesh level 6", 5e-3, kind="full", level=6),
    ],
    "cloth": [
        _set("tendons", 1e-2, quick=True), _set("tendons", 5e-3), _set("tendons", 2e-3),
        _set("tendons", 5e-4, integrator="implicitfast"), _set("tendons", 1e-3, integrator="RK4"),
        _set("tendons", 5e-4, integrator="RK4"),
    ],
}  # fmt: skip


_said: set[str] = set()


def warnings() -> list[str]:
    """Return what MuJoCo has warned of since the last call, one short text each."""
    found = sorted(_said)
    _said.clear()
    return found


def _warn(message: str) -> None:
    if "ill-conditioned" in message or "too close to singular" in message:
        _said.add("warned that its linear solve did not converge")
    elif "equality constraints or passive forces" not in message:  # said of every elastic body in 3-D
        _said.add("warned: " + message.split(".", maxsplit=1)[0])


def prepare(case: str, options: dict) -> Prepared:
    """Return the model of a case, compiled."""
    mujoco.set_mju_user_warning(_warn)  # else it writes a log file
    _said.clear()
    if case == "cloth":
        return _cloth(**options)
    return _y(case, **options) if case.startswith("y") else _bar(case, **options)


def _model(world: str, rest: str, dt: float, integrator: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian" balanceinertia="true"/><size memory="400M"/>
        <option timestep="{dt}" integrator="{integrator}" solver="Newton" tolerance="1e-6" iterations="400"
         gravity="0 0 {-cases.GRAVITY}"><flag contact="disable"/></option>
        <worldbody>{world}</worldbody>{rest}</mujoco>"""
    )


def _elastic(young: float, poisson: float, shell: float = 0.0) -> str:
    more = f'thickness="{shell}" elastic2d="both"' if shell else ""
    return f"""<elasticity young="{young}" poisson="{poisson}" {more}/>
        <contact selfcollide="none" contype="0" conaffinity="0"/>"""


def _point(name: str, position: FloatArray, mass: float) -> str:
    slides = "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1"))
    return f"""<body name="{name}" pos="{_text(position)}">{slides}<inertial pos="0 0 0" mass="{mass:.12g}"
        diaginertia="1e-9 1e-9 1e-9"/></body>"""


def _text(values: FloatArray | IndexArray) -> str:
    return " ".join(f"{v:.12g}" for v in np.ravel(values))


def _flex(
    nodes: FloatArray, elements: IndexArray, bodies: Sequence[str], origins: FloatArray, elastic: str
) -> str:
    """Return a flex whose vertices belong to `bodies`, which stand at `origins`."""
    dim = elements.shape[1] - 1
    return f"""<deformable><flex name="soft" dim="{dim}" radius="{1e-3 if dim == 2 else 0}"
        body="{" ".join(bodies)}" vertex="{_text(nodes - origins)}" element="{_text(elements)}">{elastic}
        </flex></deformable>"""


def _bar(case: str, kind: str, cells: tuple[int, int, int], dt: float, integrator: str) -> Prepared:
    elastic = _elastic(cases.YOUNG, cases.POISSON)
    if kind == "quadratic":
        count, (cx, cy, cz) = (10, 2, 2), cells
        spacing = (cases.LENGTH / count[0], cases.SIDE / count[1], cases.SIDE / count[2])
        world = f"""<flexcomp name="soft" type="grid" dim="3" count="{_text(np.add(count, 1))}" mass="{cases.MASS}"
            spacing="{_text(np.array(spacing))}" pos="{cases.LENGTH / 2} 0 0" radius="1e-4" dof="quadratic"
            cellcount="{cx} {cy} {cz}">{elastic}<pin gridrange="0 0 0 0 {2 * cy} {2 * cz}"/></flexcomp>"""
        model = _model(world, "", dt, integrator)
    else:
        mesh = cases.bar("t4", tuple(cells))
        held, _ = cases.bar_ends(mesh.nodes)
        mass = lumped(mesh, cases.MASS)[1]
        free = np.setdiff1d(np.arange(len(mesh.nodes)), held)
        world = "".join(_point(f"v{i}", mesh.nodes[i], mass[i]) for i in free)
        names = np.full(len(mesh.nodes), "world", dtype=object)
        names[free] = [f"v{i}" for i in free]
        origins = np.where((names == "world")[:, None], 0.0, mesh.nodes)
        model = _model(world, _flex(mesh.nodes, mesh.elements, list(names), origins, elastic), dt, integrator)
    data = mujoco.MjData(model)
    if kind == "quadratic":
        _weigh(model, data, cells)
    mujoco.mj_forward(model, data)
    start = data.flexvert_xpos.copy()
    _, tip = cases.bar_ends(start)
    if case == "cantilever rest":
        _drag(model, cases.BAR_DRAG)
    every = round(cases.SAMPLE.get(case, cases.REST) / dt)
    samples = round(cases.SIMULATED[case] / dt / every)

    def read() -> float:
        return float((data.flexvert_xpos[tip, 2] - start[tip, 2]).mean())

    return Prepared(
        lambda: height(np.array(_sampled(model, data, samples, every, read))), model.nv, cases.SIMULATED[case]
    )


def _weigh(model: mujoco.MjModel, data: mujoco.MjData, cells: tuple[int, int, int]) -> None:
    """Give each node of quadratic cells the integral of its shape function, as a share of the bar's mass.

    A flexcomp spreads the mass over the nodes that are free alone, and so makes a held bar too heavy.
    """
    spans = ((0.0, cases.LENGTH), (-cases.SIDE / 2, cases.SIDE), (-cases.SIDE / 2, cases.SIDE))
    for body in range(1, model.nbody):
        share = 1.0
        for axis, (low, span) in enumerate(spans):
            k = round((model.body_pos[body, axis] - low) / span * 2 * cells[axis])
            simpson = 4 if k % 2 else 1 if k in (0, 2 * cells[axis]) else 2
            share *= simpson / (6 * cells[axis])
        model.body_mass[body] = share * cases.MASS
    mujoco.mj_setConst(model, data)


def _sampled(model: mujoco.MjModel, data: mujoco.MjData, samples: int, every: int, read) -> list:
    """Return what `read` gives after each sample's steps, from the start."""
    mujoco.mj_resetData(model, data)
    found = []
    for _ in range(samples):
        mujoco.mj_step(model, data, nstep=every)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_flex(model, data)
        found.append(read())
    return found


def _drag(model: mujoco.MjModel, drag: float) -> None:
    """Damp every sliding joint in proportion to the mass of its body, and free joints likewise."""
    for dof in range(model.nv):
        body = model.dof_bodyid[dof]
        if model.jnt_type[model.dof_jntid[dof]] != mujoco.mjtJoint.mjJNT_HINGE:
            rotates = model.body_dofnum[body] == 6 and dof - model.body_dofadr[body] >= 3
            model.dof_damping[dof] = drag * (
                model.body_inertia[body].max() if rotates else model.body_mass[body]
            )


def _surface(name: str) -> tuple[FloatArray, IndexArray, FloatArray]:
    """Return mid-plane nodes [m], triangles and masses of nodes [kg] of the Y, meshed as SHELLS has it."""
    mesh = y_piece(SHELLS[name])
    low = mesh.nodes[:, 2] < 0
    quads = np.array([e[low[e]] for e in mesh.elements])
    centre = mesh.nodes[quads].mean(axis=1, keepdims=True)
    r = (mesh.nodes[quads] - centre)[..., :2]
    quads = np.take_along_axis(quads, np.argsort(np.arctan2(r[..., 1], r[..., 0]), axis=1), axis=1)
    used, quads = np.unique(quads, return_inverse=True)
    quads = quads.reshape(-1, 4)
    nodes = mesh.nodes[used] * [1, 1, 0]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return nodes, triangles, 2 * lumped(mesh, cases.SILICONE[2])[1][used]


def _y(case: str, kind: str, level: int | str, dt: float, integrator: str) -> Prepared:
    young, poisson, total = cases.SILICONE
    if kind == "shell":
        nodes, elements, mass = _surface(str(level))
        elastic = _elastic(young, poisson, 0.005)
    else:
        mesh = cases.y_mesh(int(level)).mesh
        nodes, elements, mass = np.array(mesh.nodes), np.asarray(mesh.elements), lumped(mesh, total)[1]
        elastic = _elastic(young, poisson)
    disc = cases.effector_disc(nodes, cases.Effector())
    names, origins = np.full(len(nodes), "", dtype=object), np.zeros_like(nodes)
    names[disc] = "disc"
    spread = [float((mass[disc] * (np.delete(nodes[disc], a, 1) ** 2).sum(axis=1)).sum()) for a in range(3)]
    spread = [max(s, 1e-9) for s in spread]
    world = f"""<body name="disc"><freejoint/><inertial pos="0 0 0" mass="{mass[disc].sum():.12g}"
        diaginertia="{_text(np.array(spread))}"/></body>"""
    for i, frame in enumerate(cases.servo_arms(nodes, cases.Servos())):
        names[frame.nodes], origins[frame.nodes] = f"arm{i}", frame.point
        hinge = f"""<joint name="servo{i}" type="hinge" axis="{_text(frame.axis)}" stiffness="{STIFF}"
            damping="{STIFF / 100}"/>"""
        world += f"""<body name="arm{i}" pos="{_text(frame.point)}">{hinge if case == "y L2" else ""}
            <inertial pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"/></body>"""
    free = np.flatnonzero(names == "")
    world += "".join(_point(f"v{i}", nodes[i], mass[i]) for i in free)
    names[free], origins[free] = [f"v{i}" for i in free], nodes[free]
    model = _model(world, _flex(nodes, elements, list(names), origins, elastic), dt, integrator)
    data = mujoco.MjData(model)
    _drag(model, cases.Y_DRAG)
    servos = [model.joint(f"servo{i}").qposadr[0] for i in range(3)] if case == "y L2" else []
    steps = round(cases.REST / dt)

    def run() -> FloatArray:
        mujoco.mj_resetData(model, data)
        for k in range(steps):
            model.qpos_spring[servos] = cases.TURN * min(1.0, 2 * (k + 1) / steps)  # there in half the time
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        return height(data.body("disc").xpos[2])

    return Prepared(run, model.nv, cases.REST)


def _cloth(dt: float, integrator: str) -> Prepared:
    body = cases.cloth()
    held = set(body.fixed.tolist())
    world, site = "", '<site name="s{0}" pos="{1}"/>'
    for i, (position, mass) in enumerate(zip(body.nodes, body.mass, strict=True)):
        if i in held:
            world += site.format(i, _text(position))
        else:
            world += _point(f"v{i}", position, mass).replace("</body>", site.format(i, "0 0 0") + "</body>")
    tendons = "".join(
        f"""<spatial springlength="0 {rest:.12g}" stiffness="{k:.12g}" damping="{c:.12g}"><site site="s{i}"/>
        <site site="s{j}"/></spatial>"""
        for (i, j), rest, k, c in zip(body.ends, body.rest_length, body.stiffness, body.damping, strict=True)
    )
    model = _model(world, f"<tendon>{tendons}</tendon>", dt, integrator)
    data = mujoco.MjData(model)
    every, order = round(cases.SAMPLE["cloth"] / dt), [model.site(f"s{i}").id for i in range(len(body.nodes))]
    samples = len(cases.CLOTH_TIMES)

    def run() -> FloatArray:
        mujoco.mj_resetData(model, data)
        found = []
        for _ in range(samples):
            mujoco.mj_step(model, data, nstep=every)
            mujoco.mj_kinematics(model, data)
            found.append(cases.cloth_read(data.site_xpos[order]))
        return np.array(found)

    return Prepared(run, model.nv, cases.SIMULATED["cloth"])
