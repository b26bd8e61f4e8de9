"""From a scene's full model to its reduced one."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from tripod_sim.build import Parts, Stepper
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.reduced.basis import Basis
from tripod_sim.reduced.stepper import ReducedStepper
from tripod_sim.reduced.system import FloatArray, ReducedSystem
from tripod_sim.scene import Scene
from tripod_sim.system import System

if TYPE_CHECKING:
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.forces.rayleigh import StiffnessDamping


Integrate = Callable[[Scene, System, "Anchor | None", FloatArray], Stepper]


def reduced_parts(
    scene: Scene, full: Parts, find_basis: Callable[[Scene, Parts], Basis], integrate: Integrate
) -> Parts:
    """Return the parts of the reduced model of `scene`.

    Args:
        scene: With `reduced`.
        full: What `build` makes of the scene without it.
        find_basis: Trains, or knows the basis from an earlier training.
        integrate: Makes the time integrator or static solver of a system, for its inertia and masses [kg].

    Raises:
        SceneError: the training finds no basis.
    """
    assert isinstance(full.system, System)
    assert scene.reduced
    reduced, basis = scene.reduced, find_basis(scene, full)
    system = ReducedSystem(full.system, full.mass, basis)
    inertia = _inertia(scene, system)
    system.add_motion(inertia, _damping(scene, system))
    scheme = integrate(scene, system, inertia, system.rows.masses)
    assert isinstance(scheme, Substeps)
    stepper = ReducedStepper(system, scheme, reduced, scene.solver.max_halvings)
    return replace(full, system=system, stepper=stepper, notes=(*full.notes, _note(scene, basis)))


def _note(scene: Scene, basis: Basis) -> str:
    assert scene.reduced
    reduced, elements = scene.reduced, len(basis.weights)
    text = (
        f"reduced model of {reduced.modes} shapes and {int((basis.weights > 0).sum())} of {elements} elements, trained "
        f"for slides to {reduced.slide:g} m and angles within {reduced.spread:g} rad of 0 to {reduced.angle:g} rad"
    )
    return text if basis.reached == 1.0 else f"{text}, in {100 * basis.reached:.0f} % of the poses asked for"


def _inertia(scene: Scene, system: ReducedSystem) -> "Anchor | None":
    if not scene.inertia:
        return None
    from tripod_sim.forces.anchor import Anchor  # noqa: PLC0415 - only with inertia

    return Anchor(len(system.rest))


def _damping(scene: Scene, system: ReducedSystem) -> "StiffnessDamping | None":
    if not (scene.damping and scene.damping.stiffness > 0):
        return None
    from tripod_sim.forces.rayleigh import StiffnessDamping  # noqa: PLC0415 - only with damping

    solid = system.solid
    return StiffnessDamping(scene.damping.stiffness, solid.elements, solid.matrices, len(system.rest))
