"""`python -m tripod_bringup` is the command `tripod`; signals are taken in hand before anything else is imported."""

from tripod_host.stop import end_at_once

end_at_once()

from tripod_bringup.cli import main  # noqa: E402

main()
