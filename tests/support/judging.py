"""Verdicts of a detector on a recording."""

from wetwell.detector.detector import Detector
from wetwell.detector.stream.block import blocks
from wetwell.protocols.messages.verdict import Verdict
from wetwell.protocols.recordings.recording import Recording


def verdicts_on(detector: Detector, recording: Recording, first_seq: int = 0) -> list[Verdict]:
    """Judge block by block: ten times as fast as sample by sample, and the same, as test_blocks.py shows."""
    return [
        verdict
        for block in blocks(recording, recording.pumps)
        for verdict in detector.update_block(block._replace(seq=block.seq + first_seq))
    ]
