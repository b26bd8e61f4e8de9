"""Expected error of predicted poses: what an identification left unknown, carried to poses that nobody measured.

With J = d pose / du, D the changes of the pose to other meshes and t the polynomials of `mesh_share`, truth less
prediction is J du + D c + t c' to first order. Given the amounts c (c' among them) du is -F c with the covariance P, so
with W = (D, t) - J F

    error = W m  ±  sqrt(J P J^T + W S W^T + J X W^T + W X^T J^T),    c ~ N(m, S):

X, the covariance of noise and amounts, is none but of values from a motion. So what the mesh makes of the pose is
mostly made good by what it has made of the values. J is exact, one linear solve for each value (`problem`). A pose at
rest has no time steps; those of a motion that was fitted are in the values.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_identify.csv_columns import EFFECTOR, Channel
from tripod_identify.errors import DataError
from tripod_identify.fit import CONFIDENCE, Fit
from tripod_identify.lack_of_fit import Smooth
from tripod_identify.measured import Measured
from tripod_identify.mesh_share import FACTOR, REST, Amounts, Shares, between
from tripod_identify.model import Rest, Told, plainly, rest_states
from tripod_identify.parameters import FRAME, MOUNT, START, Parameter, field_at, parameters, told
from tripod_identify.problem import Solved, other_elements, refined, rest_jacobian
from tripod_sim.scene import Scene

POSE = tuple(Channel(EFFECTOR[0], axis, angle) for angle in (False, True) for axis in range(3))
"""Place [m] and rotation vector [rad] of the disc, in the world."""

ELSEWHERE = (FRAME, MOUNT, START)
"""Families of values that do not move the disc."""

SAME = 1e-6
"""Share by which a value of the scene may differ from the one that was found: the digits of a file."""

MOST_BYTES = 10_000_000
"""Of a file with a posterior."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """What an identification knows of the values of a scene, of those that move the disc.

    Values that a scene takes as positive are meant as their logarithms.

    Attributes:
        values: As found on this mesh, in SI, by name.
        freedom: Of Student's t.
        amounts: Of the errors of mesh and steps, with what they do to the values; None where these are not known, then
            with `noise` alone.
        smooth: Polynomials in the commands; None where there are none, as of a motion.
        channels: Which of `POSE` the numbers of `amounts.sizes` are, -1 for none, shape (m,).
        mesh: Of the scene, in words: what `amounts` is of.
        noise: Covariance of the values by noise alone, shape (p, p).
    """

    values: dict[str, float]
    freedom: int
    amounts: Amounts | None
    smooth: Smooth | None
    channels: tuple[int, ...]
    mesh: str
    noise: FloatArray

    @property
    def quantile(self) -> float:
        """Of 90 %, in standard deviations."""
        return float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(self.freedom, 1)))


@dataclass(frozen=True, eq=False)
class Bars:
    """Expected error of poses, truth less prediction: x, y, z [m], then rotation [rad], each array of shape (k, 6).

    The truth is within 90 % bars of prediction + `mesh` + `steps`, for each number by itself.

    Attributes:
        poses: Predicted.
        mesh, steps: What is expected of each; NaN where it is not known.
        by_values: Half a bar by the values' uncertainty through noise alone.
        by_mesh: By what is unknown of mesh and steps; NaN where nothing is known of them.
        half: By both.
        known: Whether mesh and steps are in `half`.
    """

    poses: FloatArray
    mesh: FloatArray
    steps: FloatArray
    by_values: FloatArray
    by_mesh: FloatArray
    half: FloatArray
    known: bool


def posterior_of(
    fit: Fit, both: Shares | None, assumed: Told, channels: Sequence[Channel], *, motion: bool
) -> Posterior:
    """Return what is known after a fit; `both`: of mesh and steps; `channels`: of the data; `motion`: no poses."""
    own = [j for j, p in enumerate(fit.wanted) if not _elsewhere(p.name)]
    wanted = [fit.wanted[j] for j in own]
    size = np.array([1.0 if p.log else p.plausible for p in wanted])
    noise, amounts = fit.covariance[np.ix_(own, own)] * np.outer(size, size), None
    if both:
        a = both.amounts
        amounts = Amounts(
            a.noise[np.ix_(own, own)] * np.outer(size, size), a.follow[own] * size[:, None], a.mean, a.covariance,
            a.meshes, a.steps, a.terms, a.sizes, a.cross[own] * size[:, None],
        )  # fmt: skip
    return Posterior(
        {p.name: p.of_u(float(fit.u[j])) for p, j in zip(wanted, own, strict=True)},
        fit.freedom,
        amounts,
        both.smooth if both and not motion else None,
        tuple(POSE.index(c) if c in POSE else -1 for c in channels),
        repr(assumed.scene.mesh),
        noise,
    )


@dataclass(frozen=True, eq=False)
class Linearised:
    """Poses at rest and how they answer to what is not known of them.

    Attributes:
        poses: Predicted, x, y, z [m] and rotation [rad], shape (k, 6).
        jacobian: J, over the values or their logarithms, shape (k, 6, p).
        columns: (D, t), over the amounts, shape (k, 6, q); q = 0 where nothing is known of the mesh.
        more: Variance of what no data have told of it, shape (k, 6).
    """

    poses: FloatArray
    jacobian: FloatArray
    columns: FloatArray
    more: FloatArray


def pose_bars(scene: Scene, posterior: Posterior, arms: FloatArray, slides: FloatArray) -> Bars:
    """Return the expected error of the poses at rest of an identified scene; arguments and errors as `linearised`."""
    return bars_of(linearised(scene, posterior, arms, slides), posterior)


def bars_of(at: Linearised, posterior: Posterior) -> Bars:
    """Return the expected error of poses by the equation of this module."""
    J, quantile, a = at.jacobian, posterior.quantile, posterior.amounts
    if a is None:
        half = quantile * np.sqrt(np.einsum("kij,jl,kil->ki", J, posterior.noise, J))
        unknown = np.full_like(half, np.nan)
        return Bars(at.poses, unknown, unknown, half, unknown, half, known=False)
    W = at.columns - J @ a.follow
    ofstep = np.zeros(len(a.mean), dtype=bool)
    ofstep[a.meshes : a.meshes + a.steps] = True
    by_values = np.einsum("kij,jl,kil->ki", J, a.noise, J)
    by_mesh = np.einsum("kij,jl,kil->ki", W, a.covariance, W) + at.more
    by_mesh = np.maximum(by_mesh + 2 * np.einsum("kij,jl,kil->ki", J, a.cross, W), -by_values)
    return Bars(
        at.poses, W @ np.where(ofstep, 0.0, a.mean), W @ np.where(ofstep, a.mean, 0.0), quantile * np.sqrt(by_values),
        quantile * np.sqrt(np.maximum(by_mesh, 0)), quantile * np.sqrt(by_values + by_mesh), known=True,
    )  # fmt: skip


def linearised(scene: Scene, posterior: Posterior, arms: FloatArray, slides: FloatArray) -> Linearised:
    """Return the poses at rest of an identified scene, linearised.

    Args:
        scene: With the values that were found.
        posterior: What is known of them.
        arms: Where the arms stand [rad], shape (k, s).
        slides: [m], shape (k,).

    Raises:
        DataError: the scene is not the one that was identified.
        SceneError, StepError: another mesh cannot be had, a pose has no rest.
    """
    wanted = _checked(scene, posterior, slides)
    assumed = told(plainly(scene), wanted, np.array([p.to_u(posterior.values[p.name]) for p in wanted]))
    known = "servos.slide" in posterior.values
    if known:
        slides = np.full(len(arms), posterior.values["servos.slide"])
    commands = (arms - assumed.zero) / assumed.gain
    data = Measured(None, commands, None if known else slides, POSE, np.zeros((len(arms), len(POSE))))
    rest, joints = Rest(assumed.scene, data, ()), np.column_stack([arms, slides])
    states = rest_states(rest, joints)
    values = np.array([rest.observer.see(state, assumed.sensor) for state in states])
    u = np.array([p.to_u(posterior.values[p.name]) for p in wanted])
    size = np.array([1.0 if p.log else p.plausible for p in wanted])
    here = Solved(assumed, values, rest, tuple(states))
    J = rest_jacobian(here, wanted, u, assumed, data, ()) / size
    a = posterior.amounts
    if a is None:
        return Linearised(values, J, np.zeros((*values.shape, 0)), np.zeros_like(values))
    changes = []
    for k, (change, factor) in enumerate(((refined, FACTOR), (other_elements, 1.0))):
        if k < a.meshes:
            other = Rest(change(assumed).scene, data, ())
            there = between(rest, states, other, joints)
            changes.append(
                factor * (np.array([other.observer.see(s, assumed.sensor) for s in there]) - values)
            )
    columns = np.zeros((*values.shape, len(a.mean)))
    for i, change in enumerate(changes):
        columns[:, :, i] = change
    more = REST**2 * np.mean([change**2 for change in changes], axis=0)  # of what no data have told
    if posterior.smooth:
        terms = posterior.smooth.squares(np.column_stack([commands, slides])) @ a.terms
        count = terms.shape[1]
        for j, channel in enumerate(posterior.channels):
            if channel >= 0:
                first = a.meshes + a.steps + j * count
                columns[:, channel, first : first + count] = a.sizes[j] * terms
                more[:, channel] = 0.0
    return Linearised(values, J, columns, more)


def _elsewhere(name: str) -> bool:
    return any(name == family or name.startswith(family + ".") for family in ELSEWHERE)


def _checked(scene: Scene, posterior: Posterior, slides: FloatArray) -> list[Parameter]:
    """Return the parameters of a posterior. Raises DataError where scene or slides are not those it is of."""
    wanted = parameters(scene, tuple(posterior.values))
    for p in wanted:
        found = posterior.values[p.name]
        has = field_at(scene, p.name)[0] if p.is_field else found
        if abs(has - found) > SAME * max(abs(found), abs(has)):
            raise DataError(
                f"the posterior is of {p.name} = {found:.9g} {p.unit}; scene {scene.name!r} has {has:.9g}: take the "
                "scene that `tripod identify --out` wrote with it"
            )
        if p.name == "servos.slide" and np.abs(slides - found).max() > 1e-4:
            raise DataError(
                f"the identified slide is {found:.6f} m, but {slides[0]:g} m is given; use --slide {found:.6f}"
            )
    if posterior.amounts and repr(scene.mesh) != posterior.mesh:
        raise DataError(
            f"the posterior is of a scene with {posterior.mesh}; scene {scene.name!r} has {scene.mesh!r}: take the "
            "scene that `tripod identify --out` wrote with it"
        )
    return wanted


def as_json(posterior: Posterior) -> dict[str, Any]:
    """Return a posterior as a table; `posterior_from_json` takes it back."""
    a, smooth = posterior.amounts, posterior.smooth
    return {
        "values": posterior.values,
        "freedom": posterior.freedom,
        "noise": posterior.noise.tolist(),
        "mesh": posterior.mesh,
        "channels": list(posterior.channels),
        "amounts": a and {
            "noise": a.noise.tolist(), "follow": a.follow.tolist(), "mean": a.mean.tolist(),
            "covariance": a.covariance.tolist(), "meshes": a.meshes, "steps": a.steps, "terms": a.terms.tolist(),
            "sizes": a.sizes.tolist(), "cross": a.cross.tolist(),
        },
        "smooth": smooth and {
            "columns": smooth.columns.tolist(), "mean": smooth.mean.tolist(), "span": smooth.span.tolist()
        },
    }  # fmt: skip


def posterior_from_json(table: Any) -> Posterior:
    """Return the posterior of a table. Raises DataError where it is none."""
    try:
        a, smooth, names = table["amounts"], table["smooth"], dict(table["values"])
        p, m = len(names), len(table["channels"])
        amounts = None
        if a is not None:
            q = len(a["mean"])
            amounts = Amounts(
                _numbers(a["noise"], (p, p)), _numbers(a["follow"], (p, q)), _numbers(a["mean"], (q,)),
                _numbers(a["covariance"], (q, q)), int(a["meshes"]), int(a["steps"]),
                _numbers(a["terms"], (-1, (q - int(a["meshes"]) - int(a["steps"])) // m)), _numbers(a["sizes"], (m,)),
                _numbers(a["cross"], (p, q)),
            )  # fmt: skip
        polynomials = None
        if smooth is not None:
            n = len(smooth["columns"])
            polynomials = Smooth(
                np.array(smooth["columns"], dtype=np.int64), _numbers(smooth["mean"], (n,)),
                _numbers(smooth["span"], (n,)),
            )  # fmt: skip
        values = {str(name): float(value) for name, value in names.items()}
        if not (p and all(map(math.isfinite, values.values()))):
            raise ValueError
        channels = tuple(int(c) for c in table["channels"])
        return Posterior(
            values, int(table["freedom"]), amounts, polynomials, channels, str(table["mesh"]),
            _numbers(table["noise"], (p, p)),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError):
        raise DataError(
            "the file is not what `tripod identify --json` prints, or was changed; write it again"
        ) from None


def read_posterior(path: Path) -> Posterior:
    """Return the posterior in what `tripod identify --json` printed. Raises DataError."""
    try:
        return posterior_from_json(json.loads(read_file(path, MOST_BYTES))["posterior"])
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror or error}") from None
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, RecursionError):
        raise DataError(
            f"{path} contains no posterior; write it with `tripod identify ... --json > {path.name}`"
        ) from None


def _numbers(table: Any, shape: tuple[int, ...]) -> FloatArray:
    """Return finite numbers of a shape, -1 for any length. Raises ValueError."""
    found = np.array(table, dtype=np.float64)
    right = found.ndim == len(shape) and all(
        want in (-1, have) for want, have in zip(shape, found.shape, strict=True)
    )
    if not right or not np.isfinite(found).all():
        raise ValueError
    return found
