"""Compiled functions that look at the types of their arguments once."""

import pickle
import subprocess
import sys

import numpy as np

from wetwell.protocols.jit import SameTypes, compiled, plain
from wetwell.simulator.power import hydraulic_power_kw


@compiled
def add_to(values, share):
    for at in range(values.shape[0]):
        values[at] += share
    return values.shape[0]


def test_each_call_gets_its_own_arguments():
    add = SameTypes(add_to)
    first, second = np.zeros(3), np.ones(5)
    assert [add(first, 0.5), add(second, 2.0)] == [3, 5]
    assert (first.tolist(), second.tolist()) == ([0.5] * 3, [3.0] * 5)


def test_a_function_that_is_not_compiled_is_called_as_it_is():
    assert SameTypes(max)(2, 7) == 7


def test_a_kernel_is_pickled_by_its_name():
    assert pickle.loads(pickle.dumps(hydraulic_power_kw)) is hydraulic_power_kw  # noqa: S301


def test_the_plain_function_says_the_same_as_the_compiled_one():
    rng = np.random.default_rng(7)
    for flow_m3h, head_m in rng.uniform(0.0, 500.0, (100, 2)).tolist():
        assert plain(hydraulic_power_kw)(flow_m3h, head_m) == hydraulic_power_kw(flow_m3h, head_m)


def test_a_station_is_checked_without_the_compiler():
    code = (
        "import sys; from wetwell.services.stations import find_station; find_station('alpha'); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "wetwell.simulator.hydraulics" in loaded
    assert loaded.isdisjoint({"numba", "scipy", "pyarrow", "asyncio"})
