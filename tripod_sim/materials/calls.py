"""Calls of a law's compiled functions by address: the loops over elements are compiled once for all laws.

What a loop is given of a law is the array of its `addresses`, so that a scene compiles the laws that it names. The
functions keep the calling convention of Numba; 0 is the address of none, and calling it raises.
"""

from types import ModuleType
from typing import Any, Final

import numpy as np
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from tripod_host.arrays import Array, IndexArray
from tripod_sim.materials.laws import KAPPA, REST, SHEAR
from tripod_sim.materials.spectral import svd3, tangent_from_stretches

_F, _p, _law = (
    types.Array(*kind, "C") for kind in ((types.float64, 2), (types.float64, 1), (types.int64, 1))
)

STRESS, TANGENT, STRETCHES, SLOPE, DERIVATIVES = range(5)
"""Places of the addresses."""

SIGNATURES: Final = (
    types.float64(_F, _p, _F),
    types.boolean(_F, _p, types.boolean, _F),
    types.none(_p, _p, _p, _F),
    types.float64(_F, _F),
    types.float64(_p, _p, _F),
)


def addresses(law: ModuleType) -> IndexArray:
    """Return where the compiled functions of a law are, shape (5,); they are compiled here, if they are not yet."""
    functions = (law.stress, getattr(law, "tangent", None), law.stretches, *law.VOLUME)
    return np.array([_address(f, s) for f, s in zip(functions, SIGNATURES, strict=True)])


def _address(function: Any, signature: Any) -> int:
    if function is None:
        return 0
    function.compile(signature.args)
    compiled = function.overloads[signature.args]
    if compiled.signature.return_type != signature.return_type:
        raise TypeError(f"{function.py_func.__module__}.{function.__name__} is not of the type {signature}")
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def _through(place: int) -> Any:
    """Return signature and code of a call of the function at that place of `law`, the first argument."""
    own = SIGNATURES[place]

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        law = context.make_array(_law)(context, builder, values[0])
        address, convention = builder.load(cgutils.gep(builder, law.data, place)), context.call_conv
        with cgutils.if_unlikely(builder, cgutils.is_null(builder, address)):
            convention.return_user_exc(builder, ValueError, ("this address is of no elastic law",))
        function = convention.get_function_type(own.return_type, own.args).as_pointer()
        status, found = convention.call_function(
            builder, builder.inttoptr(address, function), own.return_type, own.args, values[1:]
        )
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return found

    return own.return_type(_law, *own.args), code


@intrinsic
def stress(typing: Any, law: Any, F: Any, p: Any, P: Any) -> Any:
    """Write P [Pa] and return psi [J/m³]."""
    return _through(STRESS)


@intrinsic
def volume_slope(typing: Any, law: Any, F: Any, H: Any) -> Any:
    """Write dv/dF, shape (3, 3), and return v."""
    return _through(SLOPE)


@intrinsic
def _own_tangent(typing: Any, law: Any, F: Any, p: Any, project: Any, C: Any) -> Any:
    return _through(TANGENT)


@intrinsic
def _stretches(typing: Any, law: Any, s: Any, p: Any, first: Any, second: Any) -> Any:
    return _through(STRETCHES)


@intrinsic
def _derivatives(typing: Any, law: Any, s: Any, first: Any, second: Any) -> Any:
    return _through(DERIVATIVES)


@njit(cache=True, error_model="numpy", inline="always")
def tangent(law: Array, F: Array, p: Array, project: bool, C: Array) -> None:
    """Write d²psi/dF², shape (9, 9), index 3 i + J; `project` lifts its negative eigenvalues to 1e-6 mu."""
    if law[TANGENT] == 0 or not _own_tangent(law, F, p, project, C):
        spectral_tangent(law, F, 0.0, True, p, project, C)


@njit(cache=True, error_model="numpy")
def tangent_of(law: Array, F: Array, p: Array, C: Array) -> None:
    """As `tangent` without projection, called from Python."""
    tangent(law, F, p, bool(0), C)


@njit(cache=True, error_model="numpy")
def tangent_at_mean(law: Array, F: Array, mean: float, p: Array, project: bool, C: Array) -> None:
    """Write d²psi_0/dF² + kappa (v* - c) d²v/dF² at v* = `mean`, shape (9, 9), index 3 i + J.

    `project` lifts its negative eigenvalues to 1e-6 mu.
    """
    spectral_tangent(law, F, mean, False, p, project, C)


@njit(cache=True, error_model="numpy")
def spectral_tangent(law: Array, F: Array, mean: float, own: bool, p: Array, project: bool, C: Array) -> None:
    """Write the tangent at the volume `mean`, or, with `own`, at that of F, which then changes with F."""
    U, V, s = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    first, second = np.empty(3), np.empty((3, 3))
    svd3(F, U, s, V)
    v = _derivatives(law, s, first, second)
    pressure = p[KAPPA] * ((v if own else mean) - p[REST])
    for i in range(3):
        for j in range(3):
            second[i, j] = (p[KAPPA] * first[i] * first[j] if own else 0.0) + pressure * second[i, j]
    for i in range(3):
        first[i] *= pressure
    _stretches(law, s, p, first, second)
    tangent_from_stretches(U, s, V, first, second, project, 1e-6 * p[SHEAR], C)
