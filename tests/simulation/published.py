"""What was given to the bus, and until when it could be had."""

from network import Sent
from simulated_site import Site
from windows import until_s

from wetwell.protocols.bus.keys import sample_key
from wetwell.protocols.messages.sample import Sample
from wetwell.services.detector.station_detector import VERDICT_HISTORY
from wetwell.services.historian.rows import pack
from wetwell.services.historian.samples import Samples

Key = tuple[int, int]
"""Time and number of a sample."""


def published_by(site: Site, station: str) -> dict[Key, Sent]:
    """Samples of a station that were given to the bus, in order."""
    published: dict[Key, Sent] = {}
    for sent in site.network.sent.get(sample_key(station), []):
        published.setdefault(key_of(Sample.decode(sent.payload)), sent)
    return published


def key_of(sample: Sample) -> Key:
    """What tells a sample from others."""
    return sample.time, sample.seq


def samples_of(station: str, published: dict[Key, Sent]) -> Samples:
    """The same samples in the order of their times."""
    rows = [pack(station, Sample.decode(sent.payload)) for sent in published.values()]
    return Samples.of_rows([(row.time_ns, row.seq, row.size, row.quality, row.data) for row in rows])


def keys_of(samples: Samples) -> list[Key]:
    """What tells each of them from others."""
    return list(zip(samples.time_ns.tolist(), samples.seq.tolist(), strict=True))


def until_gone_s(site: Site, payload: bytes, at_s: float) -> float:
    """Until when a verdict that was heard then can be had from who has told it. [s]"""
    until = at_s
    for key, place in site.network.places[payload]:
        sent = site.network.sent[key]
        if sent[place].at_s <= at_s:
            until = max(until, until_s(sent, place, VERDICT_HISTORY))
    return until


def begin_of(payloads: set[bytes]) -> str:
    """How one of them begins."""
    return repr(min(payloads)[:300])
