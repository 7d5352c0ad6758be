"""Many samples in one message say what they say one by one."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wetwell.detector.stream.block import LiveBlock
from wetwell.protocols.messages.message import MessageError
from wetwell.protocols.messages.sample import PumpReading, Sample
from wetwell.protocols.messages.sample_block import MOST_SAMPLES, SampleBlock
from wetwell.protocols.timestamps import MAX_STAMP_NS

NUMBERS = st.none() | st.floats(allow_nan=False, allow_infinity=False)
READINGS = st.builds(
    PumpReading,
    frequency_hz=NUMBERS,
    flow_m3h=NUMBERS,
    head_m=NUMBERS,
    power_kw=NUMBERS,
    running=st.none() | st.booleans(),
)


@st.composite
def rows(draw: st.DrawFn) -> list[Sample]:
    """Samples of one station and quality, in any order of time."""
    pumps, quality = draw(st.integers(0, 3)), draw(st.sampled_from(["good", "uncertain", "bad"]))
    return [
        Sample(
            station="alpha",
            seq=draw(st.integers(0, 2**63 - 1)),
            time=draw(st.integers(-MAX_STAMP_NS, MAX_STAMP_NS)),
            level_m=draw(NUMBERS),
            inflow_m3h=draw(NUMBERS),
            pumps=tuple(draw(READINGS) for _ in range(pumps)),
            quality=quality,
        )
        for _ in range(draw(st.integers(1, 6)))
    ]


@given(samples=rows())
def test_samples_come_out_of_a_block_as_they_went_in(samples):
    assert SampleBlock.decode(SampleBlock.of(samples).encode()).samples() == samples


@given(samples=rows(), pumps=st.integers(1, 4))
def test_values_of_a_block_are_those_that_a_detector_gets_one_by_one(samples, pumps):
    values = SampleBlock.of(samples).values(pumps)
    assert values.shape == (len(samples), 2 + 5 * pumps)
    for row, sample in zip(values, samples, strict=True):
        np.testing.assert_array_equal(row, LiveBlock(pumps).fill(sample).values[0])


def test_infinities_and_nan_are_no_value():
    sample = Sample(station="alpha", seq=0, time=0, level_m=math.inf, inflow_m3h=math.nan, pumps=())
    (again,) = SampleBlock.decode(SampleBlock.of([sample]).encode()).samples()
    assert (again.level_m, again.inflow_m3h) == (None, None)


BODY = json.loads(
    SampleBlock.of(
        [Sample(station="alpha", seq=k, time=k, level_m=1.0, pumps=(PumpReading(head_m=1.0),)) for k in range(3)]
    ).encode()
)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"seq": []}, "seq: "),
        ({"seq": [0, 1]}, "time: 3 values, must be 2 as in seq"),
        ({"seq": [0, 1, -1]}, "seq[3]: got -1"),
        ({"level_m": [1.0]}, "level_m: 1 values, must be 3 as in seq, or none"),
        ({"pumps": [{"head_m": [1.0, 2.0]}]}, "pump1_head_m: 2 values, must be 3 as in seq, or none"),
        ({"seq": [0] * (MOST_SAMPLES + 1)}, "seq: "),
        ({"schema": "wetwell.sample/1"}, "schema: got 'wetwell.sample/1'"),
    ],
)
def test_a_malformed_block_gives_one_line(change, rule):
    with pytest.raises(MessageError) as caught:
        SampleBlock.decode(json.dumps(BODY | change).encode())
    line = str(caught.value)
    assert line.startswith("sampleblock: ")
    assert line.isprintable()
    assert rule in line
