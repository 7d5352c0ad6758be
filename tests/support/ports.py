"""Ports for the servers of tests."""

import secrets
import socket

FIRST, LAST = 10_000, 32_000
"""Below those that Linux gives to outgoing connections: none of them takes one before its server is there."""


def free_port(host: str = "127.0.0.1") -> int:
    """A port of this machine that nobody listens on; drawn at random, for other tests look for theirs meanwhile."""
    while True:
        port = FIRST + secrets.randbelow(LAST - FIRST)
        try:
            with socket.create_server((host, port)):
                return port
        except OSError:
            continue
