"""How a set-up ends early."""


class MissingError(Exception):
    """Something that the machine must have first; one line for each thing, with what to install. Exit code 2."""


class StepError(Exception):
    """A step that failed although all it needs is there; the message names the log. Exit code 1."""
