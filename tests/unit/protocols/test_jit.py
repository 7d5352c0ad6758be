"""Compiled functions that look at the types of their arguments once."""

import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest

from wetwell.protocols.jit import SameTypes, _without, compiled, plain
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


def test_a_kernel_is_compiled_without_what_none_needs():
    code = (
        "import sys; from wetwell.simulator.power import hydraulic_power_kw; hydraulic_power_kw(9.0, 9.0);"
        "print(*sys.modules); import scipy, yaml, cffi; print(*sys.meta_path)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules, finders = done.stdout.splitlines()
    assert "numba" in modules.split()
    assert set(modules.split()).isdisjoint({"scipy", "yaml", "cffi"})
    assert "_Hidden" not in finders


CALLER = """
from typing import NamedTuple
from outer.{inner} import {names}
from wetwell.protocols.jit import compiled
@compiled
def twice(at: Point) -> float:
    return 2.0 * share(at.value)
"""
INNER = """
from typing import NamedTuple
from wetwell.protocols.jit import compiled
class Point(NamedTuple):
    value: float
    other: float
SHARE = 0.5
@compiled
def share(value):
    return SHARE * value
"""


def twice(folder, inner, text):
    """What a kernel says that calls a kernel in another file; its own file keeps its size and time."""
    (folder / "outer").mkdir(exist_ok=True)
    (folder / "outer" / f"{inner}.py").write_text(text)
    caller = folder / "outer" / "caller.py"
    caller.write_text(CALLER.format(inner=inner, names="Point, share"))
    os.utime(caller, ns=(10**18, 10**18))
    code = f"from outer.caller import twice; from outer.{inner} import Point; print(twice(Point(3.0, 5.0)))"
    done = subprocess.run([sys.executable, "-Bc", code], capture_output=True, text=True, check=True, cwd=folder)
    return float(done.stdout)


def test_a_kernel_is_compiled_again_when_a_constant_type_or_place_of_what_it_calls_changes(tmp_path):
    assert twice(tmp_path, "first", INNER) == 3.0
    assert twice(tmp_path, "first", INNER.replace("0.5", "1.5")) == 9.0
    reversed_fields = INNER.replace("value: float\n    other: float", "other: float\n    value: float")
    assert twice(tmp_path, "first", reversed_fields) == 5.0
    (tmp_path / "outer" / "first.py").unlink()
    assert twice(tmp_path, "other", INNER) == 3.0


def test_a_kernel_is_made_of_the_same_in_each_process():
    code = "from wetwell.simulator.power import hydraulic_power_kw as kernel; print(kernel.made_of)"
    said = {
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(said) == 1
    assert len(said.pop()) == len("\n") + 64


def test_what_is_hidden_from_one_thread_is_seen_by_another():
    with _without("this"), ThreadPoolExecutor(1) as pool:
        with pytest.raises(ModuleNotFoundError, match="'this'"):
            import_module("this")
        assert pool.submit(find_spec, "this").result() is not None
