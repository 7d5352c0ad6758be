"""Whether two checkouts do the same, byte for byte: files, verdicts, reports, output, exit codes.

    python benchmarks/compare_checkouts.py OLD NEW
    python benchmarks/compare_checkouts.py OLD NEW --only 'fault-*' --only diagnosis-none --keep build/compare

Each checkout has an environment of its own in `.venv`, made by `make .venv/.dev`. One line is printed for each item
on standard error, a JSON object at the end; exit code 1 if anything differs. What items there are say
`compare_items.py` and `--list`.
"""

import argparse
import fnmatch
import hashlib
import itertools
import json
import os
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compare_items import Item, items

DRIVER = Path(__file__).with_name("compare_driver.py")
MASKS = {
    "*": (rb'"date": "\d{4}-\d\d-\d\d"', rb'"salt": "[0-9a-f]{32}"', rb'"judging_s_per_station_day": [\d.e-]+'),
    "seal.sha256": (rb"[0-9a-f]{64}",),
    "backtest.html": (rb"<td>[\d.e-]+</td></tr>",),
}
"""What is left out of the comparison, by name of the file: the day, the salt of a trial's seals with what follows
from it, and how long a backtest took, which stands in the last column of its page."""
CORES = ("protocols", "simulator", "detector", "sim2real")
SHOWN = 300
"""Most bytes of a difference that are printed."""


@dataclass(frozen=True)
class Compared:
    """What came of an item."""

    name: str
    differences: tuple[str, ...]
    files: int
    size_bytes: int
    took_s: tuple[float, float]


class Checkout:
    """A process that runs the steps of one checkout, from the first item on."""

    def __init__(self, root: Path, python: Path | None) -> None:
        self._command = [python or root / ".venv" / "bin" / "python", "-P", DRIVER]
        plain = {"COLUMNS": "120", "LC_ALL": "C.UTF-8", "TZ": "UTC", "PYTHONPATH": str(root / "src")}
        plain["NUMBA_CACHE_DIR"] = str(kernels_of(root))
        self._environment = {name: value for name, value in os.environ.items() if "WETWELL_" not in name} | plain
        self._process: subprocess.Popen[bytes] | None = None

    def run(self, item: Item, folder: Path) -> float:
        """Run all steps of an item in a folder; the time that it took. [s]."""
        begin_s = time.perf_counter()
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for name, text in item.files.items():
            (folder / name).write_text(text)
        for step in item.steps:
            self._ask(step.as_json() | {"folder": str(folder)})
        return time.perf_counter() - begin_s

    def _ask(self, step: dict[str, Any]) -> None:
        if self._process is None:
            self._process = subprocess.Popen(  # noqa: S603 - the interpreter of the checkout
                self._command, env=self._environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        if self._process.stdin is None or self._process.stdout is None:
            raise RuntimeError("the driver has no pipes")
        self._process.stdin.write(json.dumps(step).encode() + b"\n")
        self._process.stdin.flush()
        if self._process.stdout.readline() != b"done\n":
            raise RuntimeError(f"the driver ended with code {self._process.wait()} in step {step['name']}")

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.communicate()


def kernels_of(root: Path) -> Path:
    """Folder for what is compiled from these very sources; Numba looks at no file but that of the function itself."""
    digest = hashlib.sha256()
    for package in CORES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return Path(tempfile.gettempdir(), f"compare-kernels-{digest.hexdigest()[:16]}")


def content(path: Path, folder: Path) -> bytes:
    """Bytes of a file without the folder's own name and what changes from day to day."""
    data = path.read_bytes().replace(bytes(folder), b".")
    for mask in itertools.chain.from_iterable(MASKS.get(name, ()) for name in ("*", path.name)):
        data = re.sub(mask, b"-", data)
    return data


def differences(old: Path, new: Path) -> tuple[list[str], int, int]:
    """What differs between two folders; how many files and bytes are alike."""
    names = [{str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()} for root in (old, new)]
    found = [f"{name}: only in {'old' if name in names[0] else 'new'}" for name in sorted(names[0] ^ names[1])]
    files = size_bytes = 0
    for name in sorted(names[0] & names[1]):
        before, after = content(old / name, old), content(new / name, new)
        if before == after:
            files, size_bytes = files + 1, size_bytes + len(before)
        else:
            found.append(f"{name}: {first_difference(before, after)}")
    return found, files, size_bytes


def first_difference(before: bytes, after: bytes) -> str:
    """Where two contents part, with what follows there."""
    at = next((at for at, (one, other) in enumerate(zip(before, after, strict=False)) if one != other), -1)
    at = min(len(before), len(after)) if at < 0 else at
    begin = max(before.rfind(b"\n", 0, at) + 1, at - SHOWN // 4)
    shown = [repr(data[begin : begin + SHOWN].split(b"\n", 1)[0])[1:] for data in (before, after)]
    return f"byte {at} of {len(before)} and {len(after)}\n    old {shown[0]}\n    new {shown[1]}"


def compared(item: Item, checkouts: tuple[Checkout, Checkout], room: Path) -> Compared:
    """Run an item in both checkouts, the old one first: the new one reads what it has left."""
    folders = room / "old" / item.name, room / "new" / item.name
    whole = folders[0].with_name(f"{item.name}.whole")
    old_s = 0.0 if whole.exists() else checkouts[0].run(item, folders[0])
    whole.touch()
    took_s = old_s, checkouts[1].run(item, folders[1])
    found, files, size_bytes = differences(*folders)
    for step in item.steps:
        code = (folders[0] / f"{step.name}.exit").read_text()
        if code not in step.codes:
            found.append(
                f"{step.name}: exit code {code} of the old checkout, where {' or '.join(step.codes)} is meant"
            )
    return Compared(item.name, tuple(found), files, size_bytes, took_s)


def work(waiting: "queue.SimpleQueue[Item]", given: argparse.Namespace, room: Path, done: list[Compared]) -> None:
    """Take items until none is left."""
    checkouts = Checkout(given.old, given.python), Checkout(given.new, given.python)
    while True:
        try:
            item = waiting.get_nowait()
        except queue.Empty:
            break
        result = compared(item, checkouts, room)
        done.append(result)
        took = " ".join(f"{each_s:6.1f} s" for each_s in result.took_s)
        word = "DIFFERS" if result.differences else "equal  "
        lines = "".join(f"\n  {line}" for line in result.differences)
        about = f"{result.files:4d} files {result.size_bytes / 1e6:8.2f} MB"
        sys.stderr.write(f"{word} {item.name:40} {about} {took}{lines}\n")
    for checkout in checkouts:
        checkout.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, nargs="?")
    parser.add_argument("new", type=Path, nargs="?")
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="items of this name, * for any text; may be given again"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="items at once")
    parser.add_argument(
        "--python",
        type=Path,
        help="interpreter of both, in place of their own",
    )
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="DIR",
        help="folder for all files, which stay; what it holds of the old checkout is used again",
    )
    parser.add_argument("--list", action="store_true", help="print the names of all items")
    given = parser.parse_args()
    chosen = [item for item in items() if any(fnmatch.fnmatch(item.name, name) for name in given.only or ["*"])]
    if given.list:
        print("\n".join(item.name for item in chosen))
        return
    if given.old is None or given.new is None or not chosen:
        parser.error("two checkouts and at least one item are needed")
    given.old, given.new = given.old.absolute(), given.new.absolute()
    begin_s, done = time.perf_counter(), list[Compared]()
    waiting: queue.SimpleQueue[Item] = queue.SimpleQueue()
    for item in chosen:
        waiting.put(item)
    with tempfile.TemporaryDirectory(prefix="compare-") as name:
        room = (given.keep or Path(name)).absolute()
        workers = [threading.Thread(target=work, args=(waiting, given, room, done)) for _ in range(given.jobs)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    different = sorted(result.name for result in done if result.differences)
    summary = {
        "benchmark": "compare_checkouts",
        "items": len(chosen),
        "equal": len(done) - len(different),
        "recordings": sum(item.is_recording for item in chosen),
        "files": sum(result.files for result in done),
        "mb": round(sum(result.size_bytes for result in done) / 1e6, 1),
        "different": different,
        "not_run": sorted({item.name for item in chosen} - {result.name for result in done}),
        "seconds": round(time.perf_counter() - begin_s),
    }
    print(json.dumps(summary, indent=2))
    sys.exit(1 if different or summary["not_run"] else 0)


if __name__ == "__main__":
    main()
