"""What README.md and the documents name is there: links, commands, their options, files that they read."""

import json
import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
DOCUMENTS = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))))
TEXTS = {name: (ROOT / name).read_text(encoding="utf-8") for name in DOCUMENTS}
COMMANDS = sorted(
    {
        " ".join(command.split("#")[0].split())
        for document in (re.sub(r"\\\n\s*", " ", text) for text in TEXTS.values())  # lines that go on are one
        for text in (
            *re.findall(r"`(tripod [^`]+)`", document),
            *re.findall(r"^(tripod .+)$", document, re.MULTILINE),
        )
        for command in text.split(" && ")
        if not re.match(r"tripod (\w+=|--version|NAME)", command)  # scenes of tables, no commands
    }
)
GIVEN = {
    "robot.yaml",
    "practice.yaml",
    "robot.toml",
    "robot.json",
    "robot.html",
    "bridge.toml",
    "notched.step",
    "notched.toml",
    "notched.png",
    "robot_scene.toml",
    "ost.yaml",
    "poses.csv",
    "score.html",
    "report.html",
    "servos.zero",  # no file: a value to identify
    "reach.csv",
    "reach.png",
    "run.npz",
    "run.html",
    "run.png",
    "run.gif",
    "cloth.npz",
    "my.txt",
    "out.csv",
    "out.html",
    "out.npz",
    "out.png",
    "recordings",
    "recordings/NAME",
}
"""Files of the user."""


@pytest.mark.parametrize(
    "path", [Path("README.md"), *(p.relative_to(ROOT) for p in sorted((ROOT / "docs").glob("*.md")))]
)
def test_links_lead_somewhere(path: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)", (ROOT / path).read_text(encoding="utf-8"))
    made = ("reference/", "project/", "learn/")  # with the site, whose own test follows these links
    inside = [link for link in links if "://" not in link and not link.startswith(made)]
    assert [link for link in inside if not (ROOT / path.parent / link).exists()] == []


@pytest.mark.parametrize("name", [*DOCUMENTS, "labs/README.md", "examples/README.md", "CHANGELOG.md"])
def test_each_table_has_a_head(name: str) -> None:
    """Rows behind an empty line are text to Markdown."""
    text = re.sub(
        r"^```.*?^```", "", (ROOT / name).read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    blocks = re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)
    assert [b.splitlines()[0] for b in blocks if not re.match(r".*\n\|[-:| ]+\|$", b, re.MULTILINE)] == []


def test_the_readme_is_short() -> None:
    assert len(README.split()) <= 900


def test_the_comparison_has_the_figures_of_the_peers() -> None:
    rows = json.loads((ROOT / "docs" / "peers.json").read_text(encoding="utf-8"))["rows"]
    [line] = [line for line in README.splitlines() if line.startswith("| [speed at equal error]")]
    own, _, mujoco, newton = line.split("|")[2:6]
    for cell, peer, setting in (
        (own, "tripod", "h8_modes, 5 x 1 x 1"),
        (mujoco, "MuJoCo", "quadratic, 8 x 1 x 1"),
        (newton, "Newton", "10 iterations, dt 2 ms"),
    ):
        [row] = [
            r for r in rows if (r["case"], r["peer"]) == ("cantilever rest", peer) and setting in r["setting"]
        ]
        error, time, unit = re.findall(r"([\d.]+) % in ([\d.]+) (m?s)", cell)[0]
        assert float(error) == pytest.approx(row["error"], rel=0.05)
        assert float(time) * (1e-3 if unit == "ms" else 1) == pytest.approx(row["cpu"], rel=0.05)


def test_programs_that_are_named_exist() -> None:
    programs = re.findall(
        r"`(?:python )?((?:benchmarks|docs|tripod_\w+)/[\w./-]+)[ `]", "\n".join(TEXTS.values())
    )
    assert len(programs) > 3
    assert [name for name in programs if not (ROOT / name).exists()] == []


def test_there_are_commands() -> None:
    assert len(COMMANDS) > 40


@pytest.mark.parametrize("line", COMMANDS)
def test_each_command_has_the_options_and_finds_the_files_that_it_is_shown_with(line: str) -> None:
    from typer.main import get_command

    from tripod_bringup.cli import app
    from tripod_bringup.command_groups import RENAMED

    words = shlex.split(line)[1:]
    words = [*RENAMED.get(words[0], words[:1]), *words[1:]]  # old names still work
    command = get_command(app)
    while words and words[0] in getattr(command, "commands", {}):
        command = command.commands[words.pop(0)]
    assert not (words and getattr(command, "commands", {})), f"{line!r} names no command"
    options = {"--help"} | {name for parameter in command.params for name in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options
    files = {word for word in words if re.search(r"\.[a-z]{2,4}$|^[a-z]+/", word) and "=" not in word}
    assert {name for name in files - GIVEN if not (ROOT / name).exists()} == set()
