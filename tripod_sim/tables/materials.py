"""Tables of materials: the parameters of the law, checked."""

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import law_named, vector
from tripod_sim.tables.bodies import Material, Region

YOUNG = 250e3
"""E of a table that gives neither that nor parameters [Pa]."""


def parameters_of(material: Material | Region, field: str = "material") -> FloatArray:
    """Return the vector of a table, checked; `field` is its name in messages."""
    check(material, field)
    lam, mu = lame_constants(initial_young(material), material.poisson)
    return vector(material.law, lam, mu, material.parameters)


def initial_young(material: Material | Region) -> float:
    """Return E [Pa] for small strains."""
    if not material.parameters:
        return YOUNG if material.young is None else material.young
    return float(2 * (1 + material.poisson) * law_named(material.law).shear(material.parameters))


def check(material: Material | Region, field: str) -> None:
    """Raise SceneError where a table gives what its law does not take, or lacks what it does."""
    law, own = law_named(material.law), material.parameters
    takes = f"{material.law} takes "
    if not law.PARAMETERS:
        if own:
            raise SceneError(f"{field}.parameters is {list(own)}; {takes}young and poisson: leave it out")
        return
    takes += f"parameters = [{', '.join(law.PARAMETERS)}]"
    if material.young is not None:
        raise SceneError(
            f"{field}.young is {material.young} Pa; {takes}, from which the stiffness follows: leave young out"
        )
    if len(own) not in law.COUNTS:
        counts = " or ".join(map(str, law.COUNTS))
        raise SceneError(f"{field}.parameters has {len(own)} values; {takes}: give {counts} values")
    try:
        mu = law.shear(own)
    except ValueError as error:
        raise SceneError(f"{field}.parameters is {list(own)}: {error}") from None
    if not mu > 0:
        raise SceneError(
            f"{field}.parameters is {list(own)}: the initial shear modulus is {mu:g} Pa; it must be above 0 Pa"
        )
