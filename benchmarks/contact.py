"""Contact: what a step of the shipped scenes takes, how the broad phase scales, what a step of a cloth wrapped on a
sphere takes, what is passed, time to rest.

    python benchmarks/contact.py [--small | --first-second]

One thread; CPU time. Prints a calibration, the median of a 1000 x 1000 float64 product, to compare machines by.
"""

import sys
import time
from itertools import product

import numpy as np
from calibration import calibration

from tripod_sim import Simulation, load_scene
from tripod_sim.contact.broad_phase import Boxes, Tree
from tripod_study.variations import drape

BALL = [
    "contact={contact_distance=5e-4, alarm_distance=1.5e-3}",
    'rigid=[{shape="ball", radius=0.008, mass=0.0005, position=[0.001,0.0005,0.015]}]',
]
"""The ball of `tripod_ball`."""

FIRST_SECOND: list[tuple[str, str, list[str]]] = [
    *((name, name, []) for name in ("drape", "silicone_drop", "stack")),
    ("ball on `tripod`", "tripod", BALL),
    ("`tripod_ball`", "tripod_ball", []),
]
"""What is timed, with the words that change the scene."""


def median(function, repeats: int) -> float:
    """CPU time of a call [s]."""
    function()
    taken = []
    for _ in range(repeats):
        start = time.thread_time()
        function()
        taken.append(time.thread_time() - start)
    return float(np.median(taken))


def broad_phase(sizes: list[int]) -> None:
    """Triangles spread over a surface, each overlapping a few others: n triangles against n triangles."""
    print("\n| triangles | pairs | tree, build + query [ms] |\n|---|---|---|")
    rng, times = np.random.default_rng(0), []
    for n in sizes:
        centre = rng.uniform(0, np.sqrt(n), (n, 1, 3)) * [1, 1, 0.01]
        x = (centre + rng.uniform(-0.5, 0.5, (n, 3, 3))).reshape(-1, 3)
        boxes, query = Boxes(np.arange(3 * n).reshape(-1, 3)), Boxes(np.arange(3 * n).reshape(-1, 3))
        boxes.sweep(x, x)
        query.sweep(x[::-1].copy(), x[::-1].copy())
        tree = Tree(boxes)

        def run(tree: Tree = tree, query: Boxes = query) -> None:
            tree.update()
            tree.pairs(query, 0.05)

        times.append(median(run, 5))
        print(f"| {n} | {len(tree.pairs(query, 0.05))} | {times[-1] * 1e3:.2f} |")
    slope = np.polyfit(np.log(sizes), np.log(times), 1)[0]
    print(f"\nThe tree's time grows like n^{slope:.2f}.")


def wrapped(counts: list[int], steps: int) -> None:
    """A grid cloth falls on the sphere of 506 triangles and wraps it."""
    head = (
        "median [ms] | p99 [ms] | touching: median [ms] | contacts | pressed | solves | factorisations | cut"
    )
    print(f"\n| cloth | response | {head} |\n|" + "---|" * 10)
    for response in drape.RESPONSES:
        medians = []
        for n in counts:
            mass = 0.2205 / n**2
            words = [
                "springs.source=grid",
                f"springs.nodes={n}",
                "springs.size=0.8",
                f"springs.node_mass={mass}",
                "sleep=off",
            ]
            simulation = Simulation(load_scene("drape", [*words, f"contact.response={response}"]))
            taken, solves, factorisations, cut = [], [], [], 0.0
            for _ in range(steps):
                start = time.thread_time()
                report = simulation.step()
                taken.append((time.thread_time() - start) * 1e3)
                solves.append(report.iterations)
                factorisations.append(report.factorisations)
                cut = max(cut, report.contact.cut)
            c, late = report.contact, slice(steps // 5, None)
            medians.append(np.median(taken[late]))
            print(
                f"| {n} x {n} | {response} | {np.median(taken):.1f} | {np.percentile(taken, 99):.1f} | "
                f"{medians[-1]:.1f} | {c.contacts} | {c.pressed} | {np.median(solves[late]):.0f} | "
                f"{np.median(factorisations[late]):.0f} | {cut:g} |",
                flush=True,
            )
        if len(counts) > 1:
            slope = np.polyfit(np.log(np.square(counts)), np.log(medians), 1)[0]
            print(f"\n{response}: the time grows like the nodes^{slope:.2f}.\n")


def shipped() -> None:
    """The scenes as they are, to their end, and without sleep: when they rest, and whether anything passed."""
    print(
        "\n| scene | response | sleep | nodes | at rest after [s] | end [J] | tunnelled | penetration [mm] | cut |"
        "\n|" + "---|" * 9
    )
    for name, response, sleep in product(("drape", "drape_cubes"), drape.RESPONSES, ("yes", "no")):
        words = [f"contact.response={response}", *(["sleep=off"] if sleep == "no" else [])]
        scene = load_scene(name, words)
        assert scene.springs
        assert scene.contact
        simulation = Simulation(scene)
        watch = drape.crossings_of(scene)
        sunk, cut, moving, tunnelled = 0.0, 0.0, 0.0, False
        for _ in range(round(scene.duration / scene.dt)):
            report = simulation.step().contact
            sunk, cut = max(sunk, -report.smallest_gap), max(cut, report.cut)
            tunnelled |= watch.found(simulation.positions, straight=report.parts == 1)
            if simulation.energies().kinetic >= drape.REST:
                moving = simulation.state.time
        print(
            f"| {name} | {response} | {sleep} | {len(simulation.positions)} | {moving:.2f} | "
            f"{simulation.energies().kinetic:.1e} | {'YES' if tunnelled else 'no'} | {1e3 * sunk:.3g} | {cut:g} |",
            flush=True,
        )


def variations(duration: float) -> None:
    """The report's variations, as `tripod study drape` has them, with the finer cloth and in CPU time."""
    print(
        "\n| " + " | ".join(column.title for column in drape.COLUMNS) + " |\n|" + "---|" * len(drape.COLUMNS)
    )
    for case in drape.cases(full=False):
        if case["dt"] < 1e-3:  # of a finer cloth it would take most of the time
            continue
        for response in drape.RESPONSES:
            row = {"response": response, "nodes": drape.FULL_EDGE, **case}
            row |= drape.measure(**row, duration=duration, clock=time.thread_time)
            print("| " + " | ".join(column.cell(row) for column in drape.COLUMNS) + " |", flush=True)


def first_second() -> None:
    """The first second of the shipped scenes, and of a ball on the Tripod."""
    head = "median [ms] | p99 [ms] | most [ms] | contacts | pressed | solves | factorisations | compliance"
    print(f"\n| scene | dt [ms] | {head} |\n|" + "---|" * 10)
    for title, name, words in FIRST_SECOND:
        simulation = Simulation(load_scene(name, words))
        taken, rows = [], []
        for _ in range(round(1.0 / simulation.scene.dt)):
            start = time.thread_time()
            report = simulation.step()
            taken.append((time.thread_time() - start) * 1e3)
            contact = report.contact
            few = getattr(contact, "way", "") == "compliance"
            rows.append((contact.contacts, contact.pressed, report.iterations, report.factorisations, few))
        contacts, pressed, solves, factorisations, few = np.mean(rows, axis=0)
        print(
            f"| {title} | {simulation.scene.dt * 1e3:g} | {np.median(taken):.2f} | {np.percentile(taken, 99):.1f} | "
            f"{max(taken):.1f} | {contacts:.0f} | {pressed:.0f} | {solves:.1f} | {factorisations:.2f} | {few:.0%} |",
            flush=True,
        )


def main() -> None:
    small = "--small" in sys.argv[1:]
    print(f"1000 x 1000 product: {calibration() * 1e3:.0f} ms")
    first_second()
    if "--first-second" in sys.argv[1:]:
        return
    broad_phase([1_000, 10_000] if small else [1_000, 3_000, 10_000, 30_000, 100_000])
    wrapped([16] if small else [16, 32, 48], 60 if small else 400)
    if not small:
        shipped()
    variations(0.5 if small else 10.0)


if __name__ == "__main__":
    main()
