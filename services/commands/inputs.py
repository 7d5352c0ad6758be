"""How groups list their commands, and how commands take inputs: each by an option, the first also without it."""

from collections.abc import Collection, Iterator, Sequence
from difflib import get_close_matches
from itertools import groupby
from typing import Any, ClassVar

from typer.core import TyperCommand, TyperGroup

from wetwell.protocols.errors import ConfigError
from wetwell.services.commands.options import GROUPS

OTHER_WORDS = {
    "--begin": "--from",
    "--start": "--from",
    "--since": "--from",
    "--end": "--to",
    "--until": "--to",
    "--output": "--out",
}
"""What an option is called elsewhere, and here."""


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

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the command of a line; a line with an option that it does not have is refused."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None and not ctx.resilient_parsing:
            is_group = isinstance(command, TyperGroup)
            known = [*(option for param in command.params for option in param.opts), "--help"]
            unknown = unknown_option(rest, known, _valued(command), is_group=is_group)
            if unknown is not None:
                raise ConfigError(f"'{unknown}' is no option of '{name}': {_nearest(unknown, known)}")
        return name, command, rest

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
        spelled_out = list(named_words(args, self.option, _valued(self)))
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


def _valued(command: Any) -> set[str]:
    """Options after which a value stands."""
    return {name for param in command.params if not getattr(param, "is_flag", False) for name in param.opts}


def _nearest(unknown: str, known: Sequence[str]) -> str:
    """The option that is most likely meant, or all that there are."""
    meant = OTHER_WORDS.get(unknown)
    near = [meant] if meant in known else get_close_matches(unknown, known, n=1)
    return f"the nearest is '{near[0]}'" if near else f"it has {', '.join(known)}"


def unknown_option(args: Sequence[str], known: Collection[str], valued: set[str], *, is_group: bool) -> str | None:
    """First option of a command line that its command does not have; None if there is none.

    Parameters
    ----------
    args : sequence of str
    known : collection of str
        Options of the command.
    valued : set of str
        Those after which a value stands.
    is_group : bool
        Whether the first word that stands alone is a command, which has options of its own.

    Examples
    --------
    >>> unknown_option(["alpha", "--begin=2024-01-01"], ["--from", "--to"], {"--from", "--to"}, is_group=False)
    '--begin'
    >>> unknown_option(["--from", "--begin"], ["--from", "--to"], {"--from", "--to"}, is_group=False)
    """
    words = iter(args)
    for word in words:
        if word == "--" or (is_group and not word.startswith("-")):
            return None
        name = word.partition("=")[0]
        if name.startswith("--") and name not in known:
            return name
        if word in valued:
            next(words, None)
    return None


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
