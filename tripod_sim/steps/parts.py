"""What a simulation is made of."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TypeVar

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.integrators.stepper import Stepper
from tripod_sim.state import State, TwinState, WayState
from tripod_sim.tables.method import Solver

if TYPE_CHECKING:
    from tripod_sim.bodies.assembly import Assembly, AssemblySkin
    from tripod_sim.contact.rigid_set import JoinedMesh, JoinedSkin, RigidSet
    from tripod_sim.integrators.time_error import ErrorTransport
    from tripod_sim.maze.plate import Plate
    from tripod_sim.maze.play import MazeBall
    from tripod_sim.mesh.solid_mesh import SolidMesh
    from tripod_sim.robot.observed import ObservedPoint
    from tripod_sim.robot.servo import ServoMotion
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.body import SpringBody
    from tripod_sim.springs.skin import ChainSkin
    from tripod_sim.system import System


T_co = TypeVar("T_co", covariant=True)


class Remembers(Protocol[T_co]):
    """What keeps something of its own in a state."""

    def start(self, state: State) -> T_co:
        """Return what it remembers at the start."""


class Chooses(Remembers[WayState], Protocol):
    """What chooses the steps of bodies and of a ball."""

    def ball_starts(self, state: State) -> None:
        """Take notice that the ball of `state` begins again."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What `build` made of a scene.

    Attributes:
        mesh: The mesh of a solid or the net of springs that is alone, or several bodies.
        mass: Of nodes [kg], shape (n,); zero for ghosts of a compliant clamp, which follow the mesh's nodes.
        system: The potential.
        stepper: The time integrator or the static solver.
        solver: Of the scene, with the tolerance that this leaves open.
        servos: How the servos turn; None where their angles are ideal.
        skin: What shows a body that has no surface of its own.
        plate: The maze on the disc; None without one.
        ball: How the ball in the maze moves; None without one.
        observed: The effector where it is no disc; None without.
        places: Further places of it that are observed, by name.
        errors: Carries the error of the time steps along; None where the scene does not ask for it.
        doubling: Finds that error by steps of half the length; None where nobody asks, or `errors` does.
        chosen: Chooses the steps by what they err over their way, those of the ball among them; None: nothing does.
        rigid: The rigid bodies, which `mesh` shows behind the soft one; None without any.
        check_start: Raises SceneError if positions of nodes at the start [m] pass through something; None: they do not.
        notes: What users should know of them, one sentence each.
        watches: Called after each step with the positions of nodes [m], each until it returns a note.
        assembly: The soft bodies; None without any.
        soft: How many of the nodes that show the simulation belong to each soft body; empty: all that are not rigid.
        velocities: Of nodes at the start [m/s], shape (n, 3); None: at rest.
        watched: Nodes of each marker.
    """

    mesh: "SolidMesh | SpringBody | Assembly | JoinedMesh"
    mass: FloatArray
    system: "System"
    stepper: Stepper
    solver: Solver = field(default_factory=Solver)
    servos: "ServoMotion | None" = None
    skin: "ChainSkin | AssemblySkin | JoinedSkin | None" = None
    plate: "Plate | None" = None
    ball: "MazeBall | None" = None
    observed: "ObservedPoint | None" = None
    places: "Mapping[str, ObservedPoint]" = field(default_factory=dict)
    errors: "ErrorTransport | AutomaticSprings | None" = None
    doubling: "Remembers[TwinState] | None" = None
    chosen: "Chooses | None" = None
    rigid: "RigidSet | None" = None
    check_start: Callable[[FloatArray], None] | None = None
    notes: tuple[str, ...] = ()
    watches: tuple[Callable[[FloatArray], str], ...] = ()
    assembly: "Assembly | None" = None
    soft: tuple[int, ...] = ()
    velocities: FloatArray | None = None
    watched: tuple[IndexArray, ...] = ()
