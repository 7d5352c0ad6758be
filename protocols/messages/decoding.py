"""Payloads of the bus as messages: what is none is counted, told and left out."""

import logging
from collections import Counter
from typing import TypeVar

from wetwell.protocols.messages.message import Message, MessageError
from wetwell.protocols.messages.sample import Sample
from wetwell.protocols.messages.sample_block import SampleBlock

M = TypeVar("M", bound=Message)

SampleMessage = Sample | SampleBlock
"""How samples come: one, or many of a station."""


def decoded(kind: type[M], payload: bytes, counts: Counter[str], log: logging.Logger, place: str = "") -> M | None:
    """Message in a payload; what is none is counted as `malformed`, told with the place, and None."""
    try:
        return kind.decode(payload)
    except MessageError as error:
        counts["malformed"] += 1
        log.warning("%s%s", place, error)
        return None


def samples_of(message: SampleMessage) -> list[Sample]:
    """What is in a message, one by one.

    Examples
    --------
    >>> sample = Sample(station="alpha", seq=0, time=0, level_m=1.2, pumps=())
    >>> samples_of(sample) == samples_of(SampleBlock.of([sample])) == [sample]
    True
    """
    return [message] if isinstance(message, Sample) else message.samples()
