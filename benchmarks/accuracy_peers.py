"""What docs/accuracy.md tells of other simulators, from the rows that `peers.py` has measured."""

import json
import textwrap
from typing import Any

from benchmarks import peers
from benchmarks.peers_report import TITLES, cell, cost, pareto

ENOUGH = 10.0
"""An error that counts as a result [%], for the fastest setting of a simulator."""


def section() -> str:
    """Return picture and table as Markdown: of each simulator the most exact and the fastest good setting."""
    stored = json.loads(peers.STORE.read_text(encoding="utf-8"))
    rows = [peers.Row(**row) for row in stored["rows"]]
    versions = {r.peer: r.version for r in rows if r.version}
    lines = [
        "### Other simulators on the same problems",
        "",
        "![error over CPU time of all simulators](images/peers.png)",
        "",
        *prose(
            "`python benchmarks/peers.py` runs the same bodies and loads in "
            + ", ".join(f"{peer} {version}" for peer, version in versions.items())
            + f". Of each: the most exact setting and, if it is another, the fastest within {ENOUGH:g} %. Every "
            "setting, the problems, what each simulator cannot express and why: [peers](peers.md)."
        ),
        "",
        "| problem | simulator | setting | unknowns | error [%] | CPU [s] |",
        "|---|---|---|---|---|---|",
    ]
    for case in peers.CASES:
        own = [r for r in rows if r.case == case]
        if not own or not stored["references"].get(case):
            continue
        problem = TITLES[case] + (", per simulated second" if case in ("cantilever swing", "cloth") else "")
        for peer in peers.PEERS:
            lines += [
                f"| {problem} | {r.peer} | {r.setting} | {r.unknowns} | {cell(r.error)} | {cell(cost(r))} |"
                for r in shown([r for r in own if r.peer == peer])
            ] or [f"| {problem} | {peer} | no result | | | |"]
    return "\n".join(lines).rstrip("\n")


def shown(rows: list[Any]) -> list[Any]:
    """Return the fastest row whose error is below `ENOUGH` and the most exact one, of one simulator in one case."""
    front = pareto(rows)
    good = [r for r in front if r.error < ENOUGH]
    return list({id(r): r for r in (*good[:1], *front[-1:])}.values())


def prose(text: str) -> list[str]:
    """Return lines of the documents' width."""
    return textwrap.wrap(text, 120, break_on_hyphens=False, break_long_words=False)
