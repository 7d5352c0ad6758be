"""Every command that README and docs name exists, with the options that they give it."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from wetwell.services.cli import app

ROOT = Path(__file__).parents[2]
WETWELL = typer.main.get_command(app)
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def named_commands(text: str) -> Iterator[list[str]]:
    """Words after `wetwell` of each command in code, fenced or inline."""
    blocks = re.findall(r"^```(?:sh|bash|console)?\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = [line.removeprefix("$ ") for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    inline = re.findall(r"`(wetwell [^`]+)`", text)
    for line in [*lines, *inline]:
        for command in re.split(r"&&|\|", line):
            if re.match(r"wetwell [a-z]", command.strip()):
                yield shlex.split(command, comments=True)[1:]


def command_of(words: list[str]) -> tuple[Any, list[str]]:
    """Command that the words lead to, and the words that are left."""
    command: Any = WETWELL
    while words and words[0] in getattr(command, "commands", {}):
        command, words = command.commands[words[0]], words[1:]
    return command, words


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_commands_of_a_page_exist_with_their_options(page):
    for words in named_commands(page.read_text(encoding="utf-8")):
        command, rest = command_of(words)
        assert len(rest) < len(words), f"{page.name}: no command '{words[0]}'"
        known = {name for option in command.params for name in [*option.opts, *option.secondary_opts]}
        given = {word.partition("=")[0] for word in rest if word.startswith("--")}
        assert given <= known | {"--help"}, f"{page.name}: wetwell {' '.join(words)}"


def test_the_pages_name_commands():
    assert sum(1 for page in PAGES for _ in named_commands(page.read_text(encoding="utf-8"))) > 50
