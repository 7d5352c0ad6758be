"""How probable it is that something is in a component, whether an effect of the library or something unknown."""

from collections.abc import Iterable, Sequence

from wetwell.sim2real.likelihood.posterior import DECIMALS, SetProbability, UnknownShare
from wetwell.simulator.effects import EFFECTS
from wetwell.simulator.effects.effect import Component

BY_READINGS = {("drive", "power_meter"), ("pump", "drive")}
"""Components of a term, and others that the pattern of the readings tells from them. The power is drawn by one and
read by the other; a head that is off in ramps alone, or swings within a run, is off by the speed."""


def component_probability(
    posterior: Sequence[SetProbability], unknown: Sequence[UnknownShare], pattern: Component
) -> dict[Component, float]:
    """Probability of each component in which something may be, the largest first.

    Something unknown acts in the component of the term that it changes, and so do the effects beside it in theirs. A
    discrepancy of the readings is where their pattern points, and so is what comes late or is held: no term does so.
    Whether a change of the power is the drive's or the meter's, and one of the head the pump's or the drive's, the
    pattern says too. Of components that are as probable, that of something unknown comes first.

    Parameters
    ----------
    posterior : sequence of SetProbability
    unknown : sequence of UnknownShare
        Ways in which something unknown may act, if it does.
    pattern : Component
        That the readings point to: `localise`.
    """
    found: dict[Component, float] = {}

    def add(components: Iterable[Component], probability: float) -> None:
        for component in sorted(components):
            found[component] = found.get(component, 0.0) + probability

    is_unknown = sum(one.probability for one in posterior if one.verdict == "unknown")
    places = [_place(way, pattern) for way in unknown]
    for place, way in zip(places, unknown, strict=True):
        add([place], is_unknown * way.share)
    for place, way in zip(places, unknown, strict=True):
        add(_components(way.acting) - {place}, is_unknown * way.share)
    for one in posterior:
        add(_components(one.effects), one.probability)
    return dict(sorted(found.items(), key=lambda pair: -round(pair[1], DECIMALS)))


def place_of_unknown(unknown: Sequence[UnknownShare], pattern: Component) -> Component:
    """The component in which something unknown most probably is, if there is something.

    What stands beside it is in no place of its own here: it may stand for a part of what is unknown, and it stands in
    the same set alone, too, so that it is always more probable.
    """
    found: dict[Component, float] = {}
    for way in unknown:
        place = _place(way, pattern)
        found[place] = found.get(place, 0.0) + way.share
    return max(found, key=lambda place: round(found[place], DECIMALS), default=pattern)


def _place(way: UnknownShare, pattern: Component) -> Component:
    if way.component is None or pattern == "telemetry" or (way.component, pattern) in BY_READINGS:
        return pattern
    return way.component


def _components(effects: Iterable[str]) -> set[Component]:
    return {EFFECTS[name].component for name in effects}
