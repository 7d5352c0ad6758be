"""How groups list their commands, and how commands take inputs: each by an option, the first also without it."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, ClassVar

from typer.core import TyperCommand, TyperGroup

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


def about(option: str) -> type[TyperCommand]:
    """Class of a command of which words without an option are values of this option.

    `wetwell detect field.csv --station alpha` is `wetwell detect --recording field.csv --station alpha`.

    Parameters
    ----------
    option : str
        Such as `--recording`. Where it can be given again, several words can stand.
    """
    return type("InputCommand", (_InputCommand,), {"option": option})


class _InputCommand(TyperCommand):
    option: ClassVar[str]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the option before words that stand alone; what is given twice is an error."""
        spelled_out = list(named_words(args, self.option, self._valued()))
        is_list = bool(getattr(self._subject(), "multiple", False))
        given = sum(word.partition("=")[0] == self.option for word in spelled_out)
        if given > 1 and not is_list:
            ctx.fail(f"'{self.option}' is given {given} times, by name or without: give it once")
        return super().parse_args(ctx, spelled_out)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Show the input that needs no option in the line of the usage."""
        subject: Any = self._subject()
        word = self.option.removeprefix("--").upper() + ("..." if subject.multiple else "")
        return [*super().collect_usage_pieces(ctx), word if subject.required else f"[{word}]"]

    def _subject(self) -> Any:
        return next(param for param in self.params if self.option in param.opts)

    def _valued(self) -> set[str]:
        """Options after which a value stands."""
        return {name for param in self.params if not getattr(param, "is_flag", False) for name in param.opts}


def named_words(args: Sequence[str], option: str, valued: set[str]) -> Iterator[str]:
    """Words of a command line, with the option before each that stands alone.

    Parameters
    ----------
    args : sequence of str
    option : str
        What the words that stand alone are given for.
    valued : set of str
        Options after which a value stands.

    Examples
    --------
    >>> list(named_words(["a.csv", "--seed", "7", "--json"], "--recording", {"--seed"}))
    ['--recording', 'a.csv', '--seed', '7', '--json']
    >>> list(named_words(["--seed=7", "--", "-a.csv"], "--recording", {"--seed"}))
    ['--seed=7', '--recording=-a.csv']
    """
    words = iter(args)
    for word in words:
        if word == "--":
            yield from (f"{option}={rest}" for rest in words)
        elif word.startswith("-") and word != "-":
            yield word
            if word in valued:
                yield from (value for value in [next(words, None)] if value is not None)
        else:
            yield from (option, word)
