"""Maintenance of many stations: who is looked at, and when again."""

import pytest

from wetwell.services.historian.store.interface import DAY_NS, StationSpan, StoreError
from wetwell.services.historian.store.upkeep import LOOK_AGAIN_NS, Upkeep

NOON_NS = 20 * DAY_NS + DAY_NS // 2


class StoreOfTwo:
    """Two stations that have samples until noon; `due` has something to do."""

    def __init__(self) -> None:
        self.last_ns = NOON_NS
        self.damages = 0
        self.looked: list[tuple[str, int]] = []
        self.due: list[str] = []
        self.is_away = False
        self.upkeep = Upkeep(self, (lambda *_: None, self.step))

    def stations(self) -> list[StationSpan]:
        return [StationSpan(name, 0, self.last_ns) for name in ("a", "b")]

    def newest_ns(self, _: str) -> int:
        return self.last_ns

    def step(self, station: str, newest_ns: int) -> str | None:
        if self.is_away:
            raise StoreError("away")
        self.looked.append((station, newest_ns))
        if station not in self.due:
            return None
        self.due.remove(station)
        return f"done {station}"

    def rounds(self, now_ns: int) -> list[str]:
        """Stations that are looked at until there is nothing to do."""
        self.looked.clear()
        while self.upkeep.one(now_ns) is not None:
            pass
        return [station for station, _ in self.looked]


@pytest.fixture
def store():
    store = StoreOfTwo()
    store.due = ["b"]
    assert store.rounds(NOON_NS) == ["a", "b", "b"]  # the first one is not looked at again for the second
    assert store.rounds(NOON_NS) == []
    return store


def test_samples_of_the_newest_day_change_nothing_and_others_do(store) -> None:
    store.upkeep.note({"a": (NOON_NS - 1, NOON_NS), "new": (0, 1)})
    assert store.rounds(NOON_NS) == []
    store.upkeep.note({"a": (NOON_NS - DAY_NS, NOON_NS)})
    assert store.rounds(NOON_NS) == ["a"]
    store.upkeep.note({"b": (NOON_NS, NOON_NS + DAY_NS)})
    assert store.rounds(NOON_NS) == ["b"]


def test_a_new_day_and_an_hour_and_damage_bring_a_look(store) -> None:
    store.last_ns += DAY_NS
    assert store.rounds(NOON_NS) == []  # a stamp ahead of the clock
    assert store.rounds(NOON_NS + DAY_NS) == ["a", "b"]
    assert store.looked[0] == ("a", 21 * DAY_NS)
    assert store.rounds(NOON_NS + DAY_NS + LOOK_AGAIN_NS) == ["a", "b"]
    store.damages += 1
    assert store.rounds(NOON_NS + DAY_NS + LOOK_AGAIN_NS) == ["a", "b"]


def test_a_look_that_fails_is_made_again(store) -> None:
    store.damages, store.is_away = 1, True
    with pytest.raises(StoreError):
        store.upkeep.one(NOON_NS)
    store.is_away = False
    assert store.rounds(NOON_NS) == ["a", "b"]
