"""A historian that is to be killed: takes samples from a number on, every other twenty of them in a block.

It says each time how many are acknowledged.
"""

import itertools
import sys
from pathlib import Path

from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import SampleBlock
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import DAY_NS

STEP_NS = DAY_NS // 200


def write(folder: Path, first: int) -> None:
    historian = Historian(FolderStore(folder))
    for begin in itertools.count(first, 20):
        samples = [sample(number) for number in range(begin, begin + 20)]
        if begin % 40 == 0:
            historian.handle("blocks", SampleBlock.of(samples).encode())
        else:
            for each in samples:
                historian.handle("samples", each.encode())
        historian.commit(samples[-1].time)
        sys.stdout.write(f"{begin + 20}\n")
        sys.stdout.flush()
        historian.maintain(samples[-1].time)


def sample(number: int) -> Sample:
    pump = PumpReading(flow_m3h=float(number), head_m=number / 3)
    return Sample(station="alpha", seq=number, time=number * STEP_NS, level_m=number / 7, pumps=(pump,))


if __name__ == "__main__":
    write(Path(sys.argv[1]), int(sys.argv[2]))
