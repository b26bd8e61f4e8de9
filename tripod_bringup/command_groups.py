"""How `tripod --help` lists the commands, in groups, and the old names of commands, which still work."""

import sys
from collections.abc import Mapping
from typing import Any, Final

from typer.core import TyperGroup

GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "Start here": ("doctor", "run", "up"),
    "Simulate": ("mesh", "play", "print", "show"),
    "Robot": ("calibrate", "flash", "ik", "reach", "teleop"),
    "Record": ("bag", "record"),
    "Analyse": ("explain", "identify", "study"),
    "ROS nodes that `tripod up` starts": ("driver", "sim", "view"),
}
"""The commands by the title of their group, in the order of the help."""

RENAMED: Final[Mapping[str, tuple[str, ...]]] = {
    "maze": ("print", "maze"),
    "parameters": ("print", "parameters"),
    "path": ("play",),
    "scenes": ("print", "scene"),
    "score": ("identify", "--score"),
    "solve": ("play",),
    "urdf": ("print", "urdf"),
}
"""The new words for commands that had another name. They work for one release."""


class CommandGroups(TyperGroup):
    """The commands of `tripod`, in the order of `GROUPS`; old names still work and name the new one."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        """Put each command into its group."""
        super().__init__(*arguments, **options)
        for title, names in GROUPS.items():
            for name in names:
                if command := self.commands.get(name):  # parts of the commands are groups of this class, too
                    command.rich_help_panel = title  # type: ignore[attr-defined]

    def list_commands(self, _context: Any) -> list[str]:
        """Return the names of the commands in the order of the help."""
        return [name for names in GROUPS.values() for name in names if name in self.commands]

    def resolve_command(self, context: Any, words: list[str]) -> Any:
        """Return name, command and its words; those of an old name are replaced by the new ones."""
        if new := RENAMED.get(words[0]):
            old = words[0]
            if not context.resilient_parsing:  # which a shell does to complete a line
                print(f"tripod {old}: the new name is `tripod {' '.join(new)}`", file=sys.stderr)
            words = [*new, *words[1:]]
        return super().resolve_command(context, words)
