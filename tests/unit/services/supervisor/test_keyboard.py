"""Keys of a terminal that only this test holds."""

import asyncio
import os
import pty
import sys
import termios

import pytest

from wetwell.services.supervisor.keyboard import keyboard

FLAGS = 3
"""Place of the local flags in what `termios.tcgetattr` says."""


@pytest.fixture
def terminal():
    """Both ends: where a person types, and what a program has as its standard input and output."""
    person, program = pty.openpty()
    with os.fdopen(person, "wb", buffering=0) as typed, os.fdopen(program) as seen:
        yield typed, seen


def test_keys_come_without_enter_and_the_terminal_is_as_before_at_the_end(terminal, monkeypatch):
    typed, seen = terminal
    for name in ("stdin", "stdout"):
        monkeypatch.setattr(sys, name, seen)
    before = termios.tcgetattr(seen)

    async def press() -> list[str]:
        async with keyboard() as keys:
            assert keys is not None
            flags = termios.tcgetattr(seen)[FLAGS]
            assert not flags & (termios.ICANON | termios.ECHO)
            assert flags & termios.ISIG  # Ctrl-C stays what it is
            typed.write(b" +-q")
            return [await asyncio.wait_for(keys.get(), 30.0) for _ in range(4)]

    assert asyncio.run(press()) == [" ", "+", "-", "q"]
    assert termios.tcgetattr(seen) == before


def test_where_nobody_sits_at_a_terminal_there_are_no_keys(monkeypatch, tmp_path):
    async def ask() -> object:
        async with keyboard() as keys:
            return keys

    with (tmp_path / "input").open("w+") as file:
        monkeypatch.setattr(sys, "stdin", file)
        assert asyncio.run(ask()) is None
