"""`benchmarks/fuzz.py` begins with inputs that its parsers take."""

import runpy
from pathlib import Path

import pytest

from wetwell.protocols.errors import WetwellError

pytestmark = pytest.mark.check

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NEVER_REFUSE = {"audit", "bus_page", "checkpoint"}
LIVE_AS_LONG_AS_THE_PROCESS = {"http", "modbus"}
"""They open an event loop and close none; the tests of page and server do the same with ends."""


def test_each_parser_takes_what_is_as_it_should_be_and_refuses_what_is_nested_too_deeply():
    targets = runpy.run_path(str(BENCHMARKS / "fuzz_targets.py"))
    for name, (make, seeds) in targets["parsers"]().items():
        if name in LIVE_AS_LONG_AS_THE_PROCESS:
            continue
        parse = make()
        for seed in seeds:
            if targets["DEEP"] in seed and name not in NEVER_REFUSE:
                with pytest.raises(WetwellError):
                    parse(seed)
            else:
                parse(seed)
