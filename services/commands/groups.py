"""How the help lists the commands of a group: in their order of use, each with all that is said of it."""

from itertools import groupby
from typing import Any

from typer.core import TyperGroup

from wetwell.services.commands.options import GROUPS


class CommandGroup(TyperGroup):
    """A command that has commands, told in the parts of `GROUPS` where they have one."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names in the order in which a station comes into service."""
        return sorted(super().list_commands(ctx), key=self._place)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names of each part with the whole of their help, which typer would cut to a line."""
        width = max(map(len, self.commands))
        for place, names in groupby(self.list_commands(ctx), self._place):
            with formatter.section(GROUPS[place] if place < len(GROUPS) else "Commands"):
                formatter.write_dl([(name.ljust(width), self.commands[name].help or "") for name in names])

    def _place(self, name: str) -> int:
        command: Any = self.commands[name]
        return GROUPS.index(command.rich_help_panel) if command.rich_help_panel in GROUPS else len(GROUPS)
