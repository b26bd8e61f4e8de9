"""Trains a basis: snapshots of the full model, lift and shapes, sampled elements."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tripod_sim.build import build
from tripod_sim.reduced.basis import Basis
from tripod_sim.reduced.fit import fit
from tripod_sim.reduced.training import Snapshots, take, training_scene
from tripod_sim.scene import Scene
from tripod_sim.system import System


def train(scene: Scene, progress: Callable[[float], None] = lambda _: None) -> Basis:
    """Return a basis for `scene`, with `reduced`.

    Args:
        scene: Its time step, servo dynamics, damping and start pose do not matter.
        progress: Called with the finished fraction.

    Raises:
        SceneError: the training cannot be made as the scene asks.
    """
    return basis_of(
        scene, take(scene, lambda part: progress(0.8 * part)), lambda part: progress(0.8 + 0.2 * part)
    )


def basis_of(scene: Scene, snapshots: Snapshots, progress: Callable[[float], None] = lambda _: None) -> Basis:
    """Return a basis for `scene`, with `reduced`, from its snapshots. Raises SceneError if they have too few shapes."""
    assert scene.reduced
    parts = build(training_scene(scene))
    system, tolerance = parts.system, scene.reduced.tolerance
    assert isinstance(system, System)
    lift, shapes = fit(system, parts.mass, snapshots, scene.reduced.modes)
    share = len(snapshots.poses) / scene.reduced.samples
    basis = Basis(lift, shapes, np.ones(len(system.solid.elements)), share)
    if tolerance > 0:
        from tripod_sim.reduced.sampling import sampled_weights  # noqa: PLC0415 - only with hyper-reduction

        weights = sampled_weights(system, parts.mass, basis, snapshots.poses, tolerance, progress)
        basis = replace(basis, weights=weights)
    return basis
