"""Which worker has which shard."""

from hypothesis import given
from hypothesis import strategies as st

from wetwell.services.fleet.placement import moves, shard_of

LOADS = st.lists(st.integers(0, 12), min_size=1, max_size=6)


def loads(sizes: list[int]) -> dict[str, list[int]]:
    shards = iter(range(sum(sizes)))
    return {f"worker-{k}": [next(shards) for _ in range(size)] for k, size in enumerate(sizes)}


@given(LOADS)
def test_moves_even_out_and_are_as_few_as_possible(sizes):
    load = loads(sizes)
    moved = moves(load)
    after = {name: [shard for shard in shards if shard not in moved] for name, shards in load.items()}
    for shard, worker in moved.items():
        after[worker].append(shard)
    numbers = sorted(map(len, after.values()))
    assert numbers[-1] - numbers[0] <= 1
    assert sorted(shard for shards in after.values() for shard in shards) == list(range(sum(sizes)))
    low, more = divmod(sum(sizes), len(sizes))
    fair = sorted([low + 1] * more + [low] * (len(sizes) - more))
    assert len(moved) == sum(max(size - share, 0) for size, share in zip(sorted(sizes), fair, strict=True))


@given(st.integers(1, 64))
def test_a_station_has_one_shard_whatever_others_there_are(shards):
    assert all(0 <= shard_of(f"station-{number}", shards) < shards for number in range(100))


def test_shards_are_about_equal():
    numbers = [0] * 8
    for station in range(8_000):
        numbers[shard_of(f"station-{station}", 8)] += 1
    assert max(numbers) < 1_150
    assert min(numbers) > 850
