"""Ports for the servers of tests."""

import secrets
import socket

FIRST, LAST = 10_000, 32_000
"""Below those that Linux gives to outgoing connections: none of them takes one before its server is there."""
_GIVEN: list[socket.socket] = []
"""UDP sockets on the ports that were given: no test is given one of them as long as this process lives."""


def free_port(host: str = "127.0.0.1") -> int:
    """A port of this machine that nobody listens on, and that no test that runs now was given before."""
    while True:
        port = FIRST + secrets.randbelow(LAST - FIRST)
        given = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            given.bind(("127.0.0.1", port))
            with socket.create_server((host, port)):
                _GIVEN.append(given)
                return port
        except OSError:
            given.close()
