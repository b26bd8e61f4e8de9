"""What holds for all tests."""

from hypothesis import settings

# The same examples in every run: a failure is of the code, not of the draw. No deadline: machines are shared.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
