"""Tables of how a scene is solved: Newton's method, the errors of steps and mesh."""

from dataclasses import dataclass

from tripod_sim.tables.fields import number, one_of


@dataclass(frozen=True)
class Solver:
    """Newton's method.

    Attributes:
        tolerance: Unbalanced force at which a step counts as solved [N]. The default is lowered to a thousandth of the
            weight of the lightest soft body (at 9.81 m/s² where there is no gravity) and of the loads.
        mode: `newton`: every step is solved to the tolerance; `one_solve`, solids: a step ends as soon as its error,
            estimated, is below `position_tolerance`, mostly after one evaluation of the elements (where
            servos or fixed regions hold the body; else as `newton`); springs: each stage is one linear solve with the
            tangent of the moment.
        position_tolerance: How far any node of a solid may be from the solution of its step [m], in proportion less for
            steps below 5 ms; see `mode`.
        max_iterations: Before a step is rolled back and halved; after eight times as many in parts that fail the
            simulation gives up.
        max_halvings: Before the simulation gives up.
        max_turn: Largest servo move of one static load increment [rad].
        linear: Linear solver: `ldl`, `cholmod` (optional extra), `cg` (conjugate gradients), `multigrid` (these with
            algebraic multigrid, optional extra), or `auto`, by size.
        linear_tolerance: Relative residual at which conjugate gradients stop; without effect on direct solvers.
    """

    tolerance: float = number(1e-4, unit="N", low=1e-14, high=1e3)
    mode: str = one_of("newton", "one_solve", default="newton")
    position_tolerance: float = number(5e-6, unit="m", above=0, high=1e-2)
    max_iterations: int = number(300, low=1, high=1000)
    max_halvings: int = number(8, low=0, high=20)
    max_turn: float = number(0.1, unit="rad", low=1e-4, high=7.0)
    linear: str = one_of("auto", "ldl", "cholmod", "cg", "multigrid", default="auto")
    linear_tolerance: float = number(1e-8, above=0, high=0.1)


@dataclass(frozen=True)
class TimeError:
    """The error of the time steps is estimated while the scene runs. Needs inertia.

    Attributes:
        steps: `fixed`: every step has the length dt; `auto`: it is divided, as coarsely as `tolerance` allows. A scene
            file or override says `dt = "auto"` for short; dt stays the interval of commands and outputs.
        accuracy: With `steps = "auto"`: share of the way gone that errors may add up to, such as 0.05; a note says
            where that is not promised; 0: parts may add `tolerance`.
        tolerance: Error that a part of a step may add to the position of any node [m].
        shortest: Length of a part that is accepted whatever its error [s].
        estimate: `global`: the error since the start is carried along and told; `local`: only what each part of a step
            adds is estimated, which is all that `steps = "auto"` needs, and cheaper; `auto`: `local` with automatic
            steps, else `global`.
    """

    steps: str = one_of("fixed", "auto", default="fixed")
    accuracy: float = number(0.0, low=0.0, high=1.0)
    tolerance: float = number(1e-6, unit="m", above=0, high=1.0)
    shortest: float = number(1e-6, unit="s", low=1e-9, high=1.0)
    estimate: str = one_of("auto", "global", "local", default="auto")

    @property
    def carries(self) -> bool:
        """Whether the error since the start is carried along."""
        return self.estimate == "global" or (self.estimate == "auto" and self.steps == "fixed")
