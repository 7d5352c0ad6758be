"""The files of the page: read once, compressed once, under an address that changes with their content."""

import gzip
import hashlib
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable

TYPES = {
    "css": "text/css; charset=utf-8",
    "html": "text/html; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "LICENSE": "text/plain; charset=utf-8",
}
SHELL = "index.html"
CATALOGUES = "js/words/"
"""Other languages: a browser asks for the one that it needs."""


@dataclass(frozen=True)
class Asset:
    """A file as it is sent."""

    content: bytes
    compressed: bytes
    media_type: str
    etag: str


class Assets:
    """All files of the page by name; `version` names this set of them."""

    def __init__(self) -> None:
        services = files("wetwell.services")
        contents = dict(_walk(services / "dashboard" / "static", ""))
        contents["css/theme.css"] = (services / "reports" / "theme.css").read_bytes()
        digest = hashlib.sha256()
        for name, content in sorted(contents.items()):
            digest.update(name.encode() + b"\0" + content)
        self.version = digest.hexdigest()[:12]
        modules = sorted(name for name in contents if name.startswith("js/") and not name.startswith(CATALOGUES))
        preloads = "\n".join(f'<link rel="modulepreload" href="/static/{self.version}/{name}">' for name in modules)
        shell = contents.pop(SHELL).replace(b"{version}", self.version.encode())
        self.shell = _asset(SHELL, shell.replace(b"<!-- modules -->", preloads.encode()))
        self.files = {name: _asset(name, content) for name, content in contents.items()}


def _walk(folder: Traversable, prefix: str) -> list[tuple[str, bytes]]:
    found = []
    for entry in folder.iterdir():
        if entry.is_dir():
            found += _walk(entry, f"{prefix}{entry.name}/")
        elif entry.name.rpartition(".")[2] in TYPES:
            found.append((prefix + entry.name, entry.read_bytes()))
    return found


def _asset(name: str, content: bytes) -> Asset:
    return Asset(
        content=content,
        compressed=gzip.compress(content, mtime=0),
        media_type=TYPES[name.rpartition(".")[2]],
        etag=f'"{hashlib.sha256(content).hexdigest()[:16]}"',
    )
