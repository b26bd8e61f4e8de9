"""Prepare `.venv` with everything that Tripod needs; `make setup` runs it as `python3 -m tools.setup_environment`.

Whatever Python the machine has reads this file first, so it keeps to the syntax of Python 3.6 and imports the rest
once the version is known to be new enough. Exit codes: 0 ready, 1 a step failed, 2 something is missing.
"""

import sys

OLDEST = (3, 11)


def main() -> int:
    """Check the version of Python, then prepare the environment; return the exit code."""
    if sys.version_info < OLDEST:
        sys.stderr.write(
            "setup: Python {}.{} or newer is needed, found {}.{}.{} ({}); "
            "name another one: make setup PYTHON=python3.12\n".format(
                *OLDEST, *sys.version_info[:3], sys.executable
            )
        )
        return 2
    from tools.environment import main as prepare  # noqa: PLC0415

    return prepare()


if __name__ == "__main__":
    sys.exit(main())
