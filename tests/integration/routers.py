"""Processes `wetwell router` that make a tree."""

import json
import os
import subprocess
import sys

from ports import free_port


def free_address(host: str) -> str:
    return f"{host}:{free_port(host)}"


class Router:
    """A process `wetwell router`."""

    def __init__(self, host: str, *upstream: str, **settings: str) -> None:
        self.address = free_address(host)
        given = {"endpoint": f"tcp/{self.address}"} | settings
        if upstream:
            given["upstream"] = json.dumps([f"tcp/{address}" for address in upstream])
        self._environment = os.environ | {f"WETWELL_ZENOH__{name.upper()}": value for name, value in given.items()}
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "wetwell.services", "router"]
        self._process = subprocess.Popen(command, env=self._environment, stderr=subprocess.DEVNULL)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
