"""One order of the arrays of a stream: the kernel's, the state's, and what is stored of it in a snapshot."""

import inspect
import json

import numpy as np

from wetwell.detector.curves.datasheet import datasheet_of
from wetwell.detector.detector import Detector
from wetwell.detector.runs.run_tracker import RunTracker
from wetwell.detector.stream.block import Block
from wetwell.detector.stream.loop import process_samples
from wetwell.detector.stream.state import StreamState
from wetwell.detector.stream.steady_samples import STEADY_SAMPLE

STORED = ["gate", "pumps", "pace", "rows", "phases", "meters", "blinds", "windows", "moments", "counts"]
STORED += ["sampling_steps", "lacks_head"]


def test_the_kernel_takes_a_block_and_the_state_in_the_order_of_their_fields():
    names = list(inspect.signature(process_samples.py_func).parameters)
    block = ["sample_pumps" if name == "pumps" else name for name in Block._fields]
    assert names == ["row", "stop", *block, *StreamState._fields]


def stored_arrays(detector):
    state = dict(json.loads(detector.snapshot().split(b"\n")[1])["dict"])
    return {name: array["array"] for name, array in state["arrays"]["dict"]}


def test_a_snapshot_holds_every_array_that_is_remembered_under_its_stored_name(alpha):
    remembered = RunTracker(datasheet_of(alpha)).state.remembered()
    assert list(remembered) == list(StreamState._fields[4:])
    arrays = stored_arrays(Detector(alpha.name, datasheet_of(alpha)))
    assert list(arrays) == STORED
    for array, (kind, shape, *_) in zip(remembered.values(), arrays.values(), strict=True):
        if array.dtype == STEADY_SAMPLE:
            assert (kind, shape) == ("<f8", [len(array), 10]), "rows of numbers, as form 2 has them"
        else:
            assert (np.dtype([tuple(field) for field in kind] if isinstance(kind, list) else kind)) == array.dtype
            assert shape == list(array.shape)


def test_a_steady_sample_is_ten_numbers_in_a_row():
    assert STEADY_SAMPLE.itemsize == 10 * np.dtype(np.float64).itemsize
    assert {kind for kind, _ in STEADY_SAMPLE.fields.values()} == {np.dtype(np.float64)}
