"""Checksums of rows of the live database: a bit that flips shows, and so does a row in the place of another."""

import hashlib
import struct
import zlib

from wetwell.services.historian.store.interface import DIGEST_BYTES

_KEY = struct.Struct("<qqqqq")


def sample_checksum(station: int, time_ns: int, seq: int, quality: int, size: int, data: bytes) -> int:
    """CRC-32 of a row of samples; `station` is its number in the database.

    Examples
    --------
    >>> sample_checksum(1, 2, 3, 0, 1, b"data") == sample_checksum(2, 2, 3, 0, 1, b"data")
    False
    """
    return zlib.crc32(data, zlib.crc32(_KEY.pack(station, time_ns, seq, quality, size)))


def hour_checksum(station: int, hour_ns: int, data: bytes) -> int:
    """CRC-32 of the figures of an hour."""
    return zlib.crc32(data, zlib.crc32(_KEY.pack(station, hour_ns, 0, 0, 0)))


def is_sample_intact(
    station: int, time_ns: int, seq: int, quality: int, size: int, data: bytes, last_ns: int | None, crc: int | None
) -> bool:
    """Whether a row of samples is what was written; of one without a checksum only its form is known.

    A row whose head was changed may have its checksum in the place of the time of its last sample, and none.
    """
    try:
        if crc is not None:
            return crc == sample_checksum(station, time_ns, seq, quality, size, data)
        return size >= 1 and len(data) % (8 * size) == 0 and last_ns == last_ns_of(size, data)
    except (TypeError, struct.error):  # a bit can turn a number into a text
        return False


def last_ns_of(size: int, data: bytes) -> int | None:
    """Time of the last of several samples, by their data; None of one sample.

    By the column that tells it rows are found. It has no part in the checksum, as it stands in what has.
    """
    return None if size == 1 else int.from_bytes(data[-8 * (size + 1) : -8 * size], "little", signed=True)


def is_hour_intact(station: int, hour_ns: int, data: bytes, crc: int | None) -> bool:
    """Whether figures of an hour are what was written; those of an earlier version have no checksum."""
    try:
        return crc is None or crc == hour_checksum(station, hour_ns, data)
    except (TypeError, struct.error):
        return False


def event_checksum(kind: str, station: int, time_ns: int, payload: bytes) -> int:
    """CRC-32 of a message and of its place."""
    return zlib.crc32(kind.encode(), zlib.crc32(payload, zlib.crc32(_KEY.pack(station, time_ns, 0, 0, 0))))


def is_event_intact(kind: str, station: int, time_ns: int, digest: bytes, payload: bytes, crc: int | None) -> bool:
    """Whether a message is what was written, and where; of one of an earlier version the place is not known."""
    try:
        is_same = hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest() == digest
        return is_same and (crc is None or crc == event_checksum(kind, station, time_ns, payload))
    except (AttributeError, TypeError, struct.error):
        return False
