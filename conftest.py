"""Where the tests keep compiled kernels: in a folder named after their sources, shared by all, and never stale.

Numba takes the machine code on disk for new while the file of the function itself is unchanged, whatever became of
the functions that it calls and of the constants that it holds. A folder of its own for each state of all these files
is always right, needs no deletion, and serves the workers and the processes that the tests start.
"""

import ast
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent
PACKAGES = ("protocols", "simulator", "detector", "sim2real")


def imported(source: Path) -> Iterator[Path]:
    """Files of the product from which a file imports names."""
    for node in ast.walk(ast.parse(source.read_bytes())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("wetwell."):
            module = ROOT.joinpath(*node.module.split(".")[1:])
            for path in (module, *(module / name.name for name in node.names)):
                if path.with_suffix(".py").exists():
                    yield path.with_suffix(".py")


def kernel_sources() -> list[Path]:
    """Files that hold compiled functions, and all those whose functions and constants these can hold."""
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    found, pending = set(), [path for path in files if b"numba" in path.read_bytes() or b"jit" in path.read_bytes()]
    while pending:
        path = pending.pop()
        if path not in found:
            found.add(path)
            pending.extend(imported(path))
    return sorted(found)


if "NUMBA_CACHE_DIR" not in os.environ:
    state = hashlib.sha256(b"".join(path.read_bytes() for path in kernel_sources())).hexdigest()
    os.environ["NUMBA_CACHE_DIR"] = str(ROOT / "build" / "kernels" / state[:16])
