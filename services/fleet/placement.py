"""Which shard a station belongs to, and which worker a shard; pure."""

import hashlib
from collections.abc import Mapping, Sequence


def shard_of(station: str, shards: int) -> int:
    """Shard of a station: the same on every machine and in every version, whatever other stations there are.

    Examples
    --------
    >>> [shard_of(name, 4) for name in ("alpha", "beta", "gamma")]
    [2, 2, 1]
    """
    return int.from_bytes(hashlib.blake2b(station.encode(), digest_size=8).digest()) % shards


def moves(load: Mapping[str, Sequence[int]]) -> dict[int, str]:
    """Shards that should go to another worker, so that no worker has two more than another; as few as possible.

    Parameters
    ----------
    load : dict
        Shards of each worker; workers without any are listed too.

    Examples
    --------
    >>> moves({"a": [0, 1, 2, 3], "b": []})
    {3: 'b', 2: 'b'}
    >>> moves({"a": [0, 1], "b": [2]})
    {}
    """
    left = {worker: sorted(shards) for worker, shards in load.items()}
    moved: dict[int, str] = {}
    while left:
        most = max(left, key=lambda worker: (len(left[worker]), worker))
        least = min(left, key=lambda worker: (len(left[worker]), worker))
        if len(left[most]) - len(left[least]) < 2:
            break
        shard = left[most].pop()
        left[least].append(shard)
        moved[shard] = least
    return moved
