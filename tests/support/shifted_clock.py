"""Runs `wetwell` with a time of day that is wrong by what a file says, which may change while it runs.

    python shifted_clock.py FILE detector --station alpha

The file holds one float64, in seconds. Clocks that nobody sets are left alone, as on a machine whose date is changed.
"""

import mmap
import runpy
import struct
import sys
import time
from pathlib import Path

SHIFT = struct.Struct("=d")


def shift_file(path: Path, shift_s: float = 0.0) -> Path:
    """Make the file, or change the shift in it."""
    if not path.exists():
        path.write_bytes(SHIFT.pack(shift_s))
    with path.open("r+b") as file:
        file.write(SHIFT.pack(shift_s))
    return path


def main() -> None:
    with Path(sys.argv[1]).open("rb") as file:
        shift = mmap.mmap(file.fileno(), SHIFT.size, access=mmap.ACCESS_READ)
    time_s, time_ns = time.time, time.time_ns
    time.time = lambda: time_s() + SHIFT.unpack(shift[:])[0]
    time.time_ns = lambda: time_ns() + round(1e9 * SHIFT.unpack(shift[:])[0])
    sys.argv = ["wetwell", *sys.argv[2:]]
    runpy.run_module("wetwell.services", run_name="__main__")


if __name__ == "__main__":
    main()
