"""What to do where a simulation is slower than real time: the one text that every message about it ends with."""

CHEAPER = "--accuracy draft"
"""The option that takes the cheapest setting that a study of the scene calls a draft."""

WHAT_TO_DO = (
    f"close other programs; if that is not enough, start with `{CHEAPER}`, which runs a coarser simulation "
    "(a scene of your own needs `tripod study` first)"
)
"""For people."""
