"""Studies of accuracy: one module each, with `plan(quick=...)` and `task(settings)`."""
