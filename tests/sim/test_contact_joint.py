"""The Hessian with contacts between moving bodies in it: the derivative of their gradient, in a pattern that lasts."""

import numpy as np
import pytest

from tripod_sim import Simulation, load_scene
from tripod_sim.contact import response_kernels
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.joint_hessian import JointHessian
from tripod_sim.integrators.stepper import integrator_of

SCENES = {
    "two_cloths": ["body.1.position=[0.004,0.003,0.0575]", "body.0.position=[0,0,0.0525]"],
    "pile": ["body.1.position=[0,0,0.0325]", "rigid.0.position=[0.001,0.002,0.0445]"],
}
"""Close to each other, so that they touch soon."""


@pytest.mark.parametrize("name", SCENES)
def test_what_is_factored_is_bodies_and_the_derivative_of_the_contacts_gradient(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    factor, seen, rng = JointHessian.factor, list[int](), np.random.default_rng(1)

    def checked(self: JointHessian, contacts: ContactSet, u: np.ndarray) -> bool:
        found = factor(self, contacts, u)
        if found and self.analyses and len(seen) < 10:
            upper = self._whole.toarray()
            whole = upper + np.triu(upper, 1).T
            upper = self.bodies.toarray()
            bodies = upper + np.triu(upper, 1).T
            p = rng.standard_normal(len(u))
            np.testing.assert_allclose(whole @ self.linear.solve(p), p, atol=1e-7 * np.abs(p).max())
            size = 1e-10
            ahead, behind = np.zeros((2, len(u)))
            for step, out in ((size, ahead), (-size, behind)):
                response_kernels.add_gradient(contacts.arrays, contacts.count, u + step * p, out)
            slope = (ahead - behind) / (2 * size)
            assert np.abs(slope).max() > 0
            np.testing.assert_allclose((whole - bodies) @ p, slope, atol=1e-3 * np.abs(slope).max())
            seen.append(contacts.count)
        return found

    monkeypatch.setattr(JointHessian, "factor", checked)
    simulation = Simulation(load_scene(name, SCENES[name]))
    for _ in range(10):
        simulation.step()
    assert len(seen) == 10


def test_a_pattern_is_made_anew_only_where_something_new_presses() -> None:
    simulation = Simulation(load_scene("two_cloths", SCENES["two_cloths"]))
    factorisations = sum(simulation.step().factorisations for _ in range(40))
    joint = integrator_of(simulation._stepper).world.problem._joint
    assert 0 < joint.analyses < 0.1 * factorisations
