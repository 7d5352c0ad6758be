"""Which sets are tried, and in which order, with sets whose probability is given."""

from types import SimpleNamespace

from wetwell.sim2real.attribution.search import MOST_EXTENDED, Search


class Given:
    """Effects are letters; how probable each set of them is stands in a table."""

    def __init__(self, logs, losses, masked, apart, alike, settled):
        self._settled = settled
        self._logs, self._known, self.tried = logs, {names for names in logs if len(names) == 1}, []
        self._losses, self._masked, self.tried_anew = losses, masked, []
        self._apart, self.paired = apart, []
        self._alike, self.exchanges = dict(alike), []
        self._hypotheses = {names: SimpleNamespace(fit=made(names), effects=names) for names in logs}

    def cost(self, fit):
        return self._losses.get(fit.names, -self._logs[fit.names])

    def without(self, fit, member):
        return made(name for k, name in enumerate(fit.names) if k != member)

    def beside(self, bases):
        return [SimpleNamespace(weights=None) for _ in bases]

    def with_one_more(self, bases, _):
        self.tried += [base.names for base in bases]
        return [
            made((*base.names, name))
            for base in bases
            for name in "abcdefgh"
            if name not in (*base.names, self._masked)
        ]

    def anew(self, bases, _, known):
        self.tried_anew += [base.names for base in bases]
        return [made((*base.names, self._masked)) for base in bases if {*base.names, self._masked} not in known]

    def of_pairs(self, bases, _, known):
        self.paired += [base.names for base in bases]
        return [
            made(self._apart)
            for base in bases
            if set(base.names) < set(self._apart) and frozenset(self._apart) not in known
        ]

    def exchanged(self, best, _, known):
        self.exchanges.append(best.names)
        sets = [(set(best.names) - {one}) | {other} for one, other in self._alike.items() if one in best.names]
        return [made(names) for names in sets if frozenset(names) not in known]

    @property
    def known(self):
        return {frozenset(names) for names in self._known}

    def add(self, fits):
        self._known |= {fit.names for fit in fits if fit.names in self._logs}

    def settle(self):
        self._logs |= {names: log for names, log in self._settled.items() if names in self._known}

    @property
    def weighed(self):
        return [self._hypotheses[names] for names in sorted(self._known, key=lambda names: -self._logs[names])]

    possible = weighed


def made(names):
    return SimpleNamespace(names=tuple(sorted(names)))


def searched(logs, losses=(), masked="", apart="", alike=(), settled=()):
    logs, losses, settled = (
        {tuple(sorted(names)): one for names, one in dict(its).items()} for its in (logs, losses, settled)
    )
    given = Given(logs, losses, masked, apart, alike, settled)
    return given, Search(given, given, given)


def test_greedy_choices_are_taken_back():
    given, search = searched({"a": 5.0, "b": 1.0, "c": 0.0, "ab": 6.0, "bc": 9.0})
    search.run()
    assert given.weighed[0].fit.names == ("b", "c")


def test_one_more_effect_is_tried_beside_the_sets_that_are_next_in_line():
    """The friction and the rags are each far behind the sensor that is off, and together before it."""
    given, search = searched({"a": 5.0, "b": 3.0, "c": 2.0, "d": 1.0, "e": 0.0, "bf": 9.0, "bfg": 12.0})
    search.run()
    assert given.weighed[0].fit.names == ("b", "f", "g"), "and on from there"


def test_nothing_is_tried_twice_and_a_search_that_finds_nothing_ends():
    given, search = searched(dict.fromkeys("abcdef", 1.0) | {"a": 5.0})
    search.run()
    assert len(given.tried) == len(set(given.tried)) == MOST_EXTENDED


def test_what_is_found_beside_a_set_next_in_line_is_extended_though_it_is_not_the_best():
    """A pair of a leak and a ramp is behind an area of the wet well, but for a companion."""
    logs = {"a": 5.0, "b": 3.0, "c": 0.0, "d": 0.0, "bc": 4.9, "bcd": 9.0}
    given, search = searched(logs)
    search.run()
    assert given.weighed[0].fit.names == ("b", "c", "d")


def test_a_single_effect_is_extended_that_is_less_probable_than_many_sets_of_others():
    """An unmetered inflow does much of what a leak does, and with two sensors that are off even more."""
    others = {"a": 5.0, "ac": 8.0, "ad": 8.5, "acd": 9.0, "ace": 8.9, "acf": 8.8, "acg": 8.7}
    given, search = searched(dict.fromkeys("cdefg", -9.0) | others | {"b": 3.0, "bf": 10.0, "bfg": 12.0})
    search.run()
    assert given.weighed[0].fit.names == ("b", "f", "g")


def test_the_set_of_each_size_that_leaves_least_is_extended_though_others_are_likelier():
    """A slip and an inertia leave a head that is late far off, as a bent ramp and wear do, and less of all else."""
    logs = dict.fromkeys("bcdefg", -9.0) | {
        "a": 5.0,
        "ab": 8.0,
        "ac": 7.9,
        "ad": 7.8,
        "e": 4.0,
        "ef": 7.0,
        "efg": 12.0,
    }
    given, search = searched(logs, {"ef": -99.0})
    search.run()
    assert given.weighed[0].fit.names == ("e", "f", "g")


def test_where_it_takes_many_effects_fewer_are_tried_with_one_that_promises_nothing_alone():
    """A gain and an offset do the work of a leak, which alone does something else."""
    logs = {"a": 5.0, "b": 3.0, "c": 1.0, "d": 0.0, "ab": 8.0, "abc": 8.5, "abcd": 9.0, "h": -9.0, "abh": 20.0}
    given, search = searched(logs, masked="h")
    search.run()
    assert given.weighed[0].fit.names == ("a", "b", "h")
    assert len(given.tried_anew) == len(set(given.tried_anew))


def test_a_set_of_two_is_taken_as_it_is():
    given, search = searched({"a": 5.0, "b": 3.0, "ab": 8.0, "abh": 20.0}, masked="h")
    search.run()
    assert given.weighed[0].fit.names == ("a", "b")
    assert not given.tried_anew


def test_no_set_grows_beyond_three_effects_and_an_inertia():
    logs = {"abcde"[: k + 1]: float(k) for k in range(5)}
    given, search = searched(dict.fromkeys("abcde", -9.0) | logs)
    search.run()
    assert max(len(one.fit.names) for one in given.weighed) == 4


def test_a_pair_is_tried_of_which_neither_part_is_near_and_extended():
    """Wear and a head sensor that reads high undo each other in the head: other effects are nearer, one by one."""
    logs = {"a": 9.0, "b": 8.0, "c": 7.0, "h": -50.0, "i": -60.0, "hi": 12.0, "hij": 15.0}
    given, search = searched(logs | {"ahi": -9.0}, apart="hi")
    given.with_one_more = lambda bases, _: [made((*base.names, name)) for base in bases for name in "abcj"]
    search.run()
    assert given.weighed[0].fit.names == ("h", "i", "j")
    assert len(given.paired) == len(set(given.paired))
    assert not {("a",), ("b",)} & set(given.paired), "what was tried beside those is known"


def test_an_effect_is_exchanged_for_one_that_does_the_like_though_nothing_promised_it():
    """Beside another inflow the friction was tried, and the lift was not."""
    given, search = searched({"a": 5.0, "b": 3.0, "ab": 8.0, "ah": 12.0}, masked="h", alike={"b": "h"})
    search.run()
    assert given.weighed[0].fit.names == ("a", "h")
    assert given.exchanges == [("a", "b"), ("a", "h")], "once for each set that was the best"


def test_what_stands_first_once_near_sets_are_settled_is_extended_too():
    """A friction stood behind another set until it was settled, and the lift beside its companion was never tried."""
    logs = {"a": 9.0, "b": 1.0, "c": 0.9, "d": 8.0, "de": 8.9, "def": 8.8, "deg": 20.0}
    given, search = searched(logs, masked="g", alike={"f": "g"}, settled={"a": 5.0, "def": 9.5})
    search.run()
    assert given.weighed[0].fit.names == ("d", "e", "g")
