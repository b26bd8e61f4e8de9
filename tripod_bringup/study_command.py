"""`tripod study`: a table of one scene under many settings, on the screen, as JSON or CSV."""

import csv
import json
import sys
from pathlib import Path
from typing import Any

from tripod_bringup.run_command import BAD_ARGUMENTS, plain, progress_bar


def run_study(name: str, *, full: bool, out: Path | None, as_json: bool, quiet: bool) -> int:
    """Run a study and print its table; return the exit code: 2 for a study that is unknown or a file not writable."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.study.catalogue import study  # noqa: PLC0415

    try:
        if out:
            out.open("a").close()  # before the work, not after it
        made = study(name, full=full)
        rows: list[dict[str, Any]] = []
        with progress_bar(shown=not quiet and sys.stderr.isatty()) as progress:
            for row in made.rows:
                rows.append(row)
                if progress:
                    progress(len(rows) / made.count)
        if out:
            with out.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, [column.key for column in made.columns])
                writer.writeheader()
                writer.writerows(rows)
    except SceneError as error:
        print(f"tripod study: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        print(f"tripod study: --out {str(out)!r} cannot be written: {why}", file=sys.stderr)
        return BAD_ARGUMENTS
    if as_json:
        print(json.dumps({"study": name, "title": made.title, "rows": plain(rows)}))
        return 0
    cells = [[column.title for column in made.columns]]
    cells += [[column.text(row[column.key]) for column in made.columns] for row in rows]
    widths = [max(len(line[i]) for line in cells) for i in range(len(made.columns))]
    print(made.title)
    for line in cells:
        print("  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip())
    return 0
