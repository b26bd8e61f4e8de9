"""A process for the supervisor's tests: notes what happens to it in a file, one line an event.

python fake_child.py NAME LOG [OPTION ...]
"""

import argparse
import os
import signal
import sys
import time
from pathlib import Path

parser = argparse.ArgumentParser()
parser.add_argument("name")
parser.add_argument("log", type=Path)
parser.add_argument("--die-after", type=float)
parser.add_argument("--die-with", help="die once this one has started")
parser.add_argument("--work", type=float, default=0.0)
parser.add_argument("--code", type=int, default=0)
parser.add_argument("--stop-code", type=int, default=0)
parser.add_argument("--stop-time", type=float, default=0.0)
parser.add_argument("--deaf", action="store_true")
parser.add_argument("--starting", action="store_true")
parser.add_argument("--say", action="append", default=[])
given = parser.parse_args()


def note(event: str) -> None:
    with given.log.open("a") as file:
        file.write(f"{event} {given.name} {os.getpid()}\n")


def on_term(*_: object) -> None:
    note("asked")
    if given.deaf:
        return
    begun = time.monotonic()
    while time.monotonic() < begun + given.stop_time:
        time.sleep(0.02)
    note("ended")
    sys.exit(given.stop_code)


if not given.starting:
    signal.signal(signal.SIGTERM, on_term)
signal.signal(signal.SIGINT, lambda *_: note("interrupted"))
for line in given.say:
    print(line)
while time.process_time() < given.work:
    pass
note("started")
while given.die_with and f"started {given.die_with} " not in given.log.read_text():
    time.sleep(0.02)
if given.die_with:
    given.die_after = 0.0
begun = time.monotonic()
while given.die_after is None or time.monotonic() < begun + given.die_after:
    time.sleep(0.02)
print(f"{given.name} breaks", file=sys.stderr)
note("died")
sys.exit(given.code)
