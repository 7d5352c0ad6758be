"""A historian that is to be killed: takes samples from a number on, and says each time how many are acknowledged."""

import itertools
import sys
from pathlib import Path

from wetwell.protocols.messages import PumpReading, Sample
from wetwell.services.historian.core import Historian
from wetwell.services.historian.folder_store import FolderStore
from wetwell.services.historian.store import DAY_NS

STEP_NS = DAY_NS // 200


def write(folder: Path, first: int) -> None:
    historian = Historian(FolderStore(folder))
    for number in itertools.count(first):
        pump = PumpReading(flow_m3h=float(number), head_m=number / 3)
        sample = Sample(station="alpha", seq=number, time=number * STEP_NS, level_m=number / 7, pumps=(pump,))
        historian.take("samples", sample.encode())
        if number % 20 == 19:
            historian.commit(sample.time)
            sys.stdout.write(f"{number + 1}\n")
            sys.stdout.flush()
            historian.maintain(sample.time)


if __name__ == "__main__":
    write(Path(sys.argv[1]), int(sys.argv[2]))
