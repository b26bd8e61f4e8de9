"""Errors of the simulator."""


class SceneError(ValueError):
    """A scene, mesh or command that is refused; the message names the field, its value and what is allowed."""


class StepError(RuntimeError):
    """A step that could not be saved; the simulation keeps the last good state. The message names what failed."""
