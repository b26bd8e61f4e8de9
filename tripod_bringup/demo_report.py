"""The end of the demo: looks at the recording, prints the table, says whether the chain ran."""

import sys
from pathlib import Path

from tripod_bringup.demo_summary import Measurements, RecordingFacts, conclusion, problems, summary_rows
from tripod_bringup.screen import Screen


def report_demo(
    measured: Measurements, *, recording: str, lost: str, expect_recording: bool, screen: Screen
) -> bool:
    """Print what was measured; return whether the whole chain ran.

    Args:
        measured: By the demo's node.
        recording: Path that the recorder told, empty if none.
        lost: What the recorder said of a recording that is not whole; empty if it is, or nothing was said.
        expect_recording: Whether there should be one.
        screen: Where to print.
    """
    facts = recording_facts(Path(recording), lost) if recording else None
    if facts is None and expect_recording:
        facts = RecordingFacts(Path(), 0, None, "the recorder did not report its file")
    rows = summary_rows(measured, facts)
    width = max(len(name) for name, _ in rows)
    for name, figure in rows:
        screen.line(f"{name:<{width}}  {figure}")
    found = problems(measured, facts)
    for problem in found:
        print(f"tripod up: the demo failed: {problem}", file=sys.stderr)
    if not found:
        screen.line(conclusion(measured))
    return not found


def recording_facts(path: Path, lost: str = "") -> RecordingFacts:
    """Return size and message count of a recording; `lost`: what its recorder said is missing, and why."""
    from tripod_record.errors import RecordError  # noqa: PLC0415 - only where something was recorded
    from tripod_record.info import read_info  # noqa: PLC0415

    try:
        info = read_info(path)
    except (RecordError, OSError) as error:
        return RecordingFacts(path, 0, None, lost or str(error))
    return RecordingFacts(path, info.size, info.messages, lost or info.truncated or "; ".join(info.damage))
