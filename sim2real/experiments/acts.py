"""The acts that are tried: a row each in `ACTS`."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

from wetwell.protocols.orders import Step
from wetwell.sim2real.experiments.act import Act, Site

REPEATS = 2
"""How often what is quickly over is done: once could be chance."""
RUN_S = 600.0
"""Longest run that is asked for. [s]"""
LONG_S = 3600.0
"""Longest run of a pump that is left to run for long. [s]"""
IDLE_S = 3600.0
SHUT_S = 60.0
"""How long a station is left standing, and a pump held against a shut valve. [s]"""
BEFORE_SHUT_S = 60.0
"""Run before the valve is shut. [s]"""
STANDING_S = 300.0
"""How long the wet well is watched with nothing coming in and nothing running. [s]"""
RATIOS = (0.9, 0.8, 0.7)
"""Speeds that are tried, as shares of nominal. [1]"""
PEOPLE_ON_SITE = 2
TRAVEL_H = 1.0
"""Who turns a valve by hand goes there, and not alone; way there and back. [h]"""


def at_speeds(site: Site) -> Iterator[Act]:
    """One pump at a lower speed."""
    for i in site.apart:
        for ratio in RATIOS:
            if ratio > site.least_ratio:
                run = _run(site, ratio, i)
                yield Act(
                    name=f"pump_{i + 1}_at_{round(100 * ratio)}",
                    sentence=f"Let the wet well fill, then run pump {i + 1} alone at {100 * ratio:g} % of its speed, "
                    f"{REPEATS} times.",
                    steps=(site.fill(site.brim_m), run) * REPEATS,
                )


def tour(site: Site) -> Iterator[Act]:
    """One session of many duties: ever lower speeds, each down to a low stop, and two pumps where there are two."""
    for i, lowest in product(site.apart, _lowest(site)):
        yield Act(
            name=f"tour_pump_{i + 1}_to_{round(100 * lowest)}",
            sentence=f"{_said(site, i, lowest)}.",
            steps=_duties(site, i, lowest),
        )


def tour_and_rest(site: Site) -> Iterator[Act]:
    """All that can be done at the screens in one session: a tour, rests of an hour, and a long run after each."""
    for i, lowest in product(site.apart, _lowest(site)):
        pair = _together(site, i)
        slow_pair = (site.fill(site.brim_m), _run(site, lowest, *pair)) if len(pair) > 1 else ()
        long_runs = (replace(_low_run(site, ratio, i), longest_s=LONG_S) for ratio in (lowest, 1.0))
        said = f" and with it at {100 * lowest:g} %" if slow_pair else ""
        yield Act(
            name=f"tour_and_rest_pump_{i + 1}_to_{round(100 * lowest)}",
            sentence=f"{_said(site, i, lowest)}{said}. Then let all pumps stand for an hour or until the wet well is "
            f"full, and run pump {i + 1} at {100 * lowest:g} % down to that level, for an hour at most; do so again "
            "at full speed.",
            steps=(
                *_duties(site, i, lowest),
                *slow_pair,
                *(step for run in long_runs for step in (_stand(site), run)),
            ),
        )


def _lowest(site: Site) -> list[float]:
    """Speeds down to which a tour goes, as shares of nominal. [1]."""
    return [ratio for ratio in RATIOS[1:] if ratio > site.least_ratio]


def _together(site: Site, i: int) -> tuple[int, ...]:
    """A pump, and another one where there is one."""
    return tuple(dict.fromkeys((i, *site.ready)))[:2]


def _low_run(site: Site, ratio: float, pump: int) -> Step:
    """A pump runs down to under the stop level: two would be below what is allowed before they stand."""
    return replace(_run(site, ratio, pump), low_m=site.low_m)


def _duties(site: Site, i: int, lowest: float) -> tuple[Step, ...]:
    """Runs of a pump at ever lower speeds, at full speed, and with another one."""
    pair = _together(site, i)
    runs = [_low_run(site, ratio, i) for ratio in (*RATIOS, 1.0) if ratio >= lowest]
    pairs = [_run(site, 1.0, *pair)] if len(pair) > 1 else []
    return tuple(step for run in (*runs, *pairs) for step in (site.fill(site.brim_m), run))


def _said(site: Site, i: int, lowest: float) -> str:
    """What asks for these runs."""
    pair = _together(site, i)
    ratios = ", ".join(f"{100 * ratio:g}" for ratio in (*RATIOS, 1.0) if ratio >= lowest)
    with_it = f", then with pump {pair[1] + 1} down to the stop level" if len(pair) > 1 else ""
    return (
        f"Let the wet well fill before each run, and run pump {i + 1} down to {site.low_m:.2f} m, under the stop "
        f"level, at {ratios} % of its speed{with_it}"
    )


def two_together(site: Site) -> Iterator[Act]:
    """Two pumps at once."""
    if len(site.ready) > 1:
        first, second = site.ready[:2]
        yield Act(
            name=f"pumps_{first + 1}_and_{second + 1}",
            sentence=f"Let the wet well fill, then run pumps {first + 1} and {second + 1} together, {REPEATS} times.",
            steps=(site.fill(site.brim_m), _run(site, 1.0, first, second)) * REPEATS,
        )


def idle(site: Site) -> Iterator[Act]:
    """An hour in which nothing runs, and a long run after it."""
    i = site.ready[0]
    yield Act(
        name="idle_hour",
        sentence="Empty the wet well, let all pumps stand for an hour or until it is full, then pump it down with "
        f"pump {i + 1}.",
        steps=(_run(site, 1.0, i), _stand(site), _run(site, 1.0, i)),
    )


def pumped_low(site: Site) -> Iterator[Act]:
    """From the highest to the lowest level in one run."""
    for i in site.apart:
        run = _low_run(site, 1.0, i)
        yield Act(
            name=f"pump_{i + 1}_low",
            sentence=f"Let the wet well fill, then run pump {i + 1} down to {site.low_m:.2f} m, "
            f"under the stop level, {REPEATS} times.",
            steps=(site.fill(site.brim_m), run) * REPEATS,
        )


def against_valve(site: Site) -> Iterator[Act]:
    """A pump against a shut valve."""
    for i in site.apart:
        run = _run(site, 1.0, i)
        yield Act(
            name=f"pump_{i + 1}_valve_shut",
            sentence=f"Run pump {i + 1}, shut its valve for {SHUT_S:g} s while it runs, and open it again.",
            steps=(
                site.fill(site.brim_m),
                replace(run, longest_s=BEFORE_SHUT_S),
                replace(run, longest_s=SHUT_S, is_valve_shut=True),
                replace(run, longest_s=BEFORE_SHUT_S),
            ),
            people=PEOPLE_ON_SITE,
            travel_h=TRAVEL_H,
        )


def bucket(site: Site) -> Iterator[Act]:
    """The wet well as a bucket: nothing comes in, and one pump empties it."""
    for i in site.apart:
        yield Act(
            name=f"bucket_pump_{i + 1}",
            sentence=f"Let the wet well fill, shut the inlet, watch the level for {STANDING_S / 60:g} minutes, then "
            f"empty it with pump {i + 1}: its fall is what the flow meter must show.",
            steps=(
                site.fill(site.brim_m),
                Step(longest_s=STANDING_S, speed_ratio=site.speeds(0.0), is_inlet_shut=True),
                replace(_run(site, 1.0, i), is_inlet_shut=True),
            ),
            people=PEOPLE_ON_SITE,
            travel_h=TRAVEL_H,
        )


def _run(site: Site, ratio: float, *pumps: int) -> Step:
    """Some pumps run until the wet well is as empty as usual, or as full as can be."""
    return Step(longest_s=RUN_S, speed_ratio=site.speeds(ratio, *pumps), low_m=site.stop_m, high_m=site.high_m)


def _stand(site: Site) -> Step:
    """Nothing runs for an hour, or until the wet well is full."""
    return Step(longest_s=IDLE_S, speed_ratio=site.speeds(0.0), high_m=site.brim_m)


ACTS: tuple[Callable[[Site], Iterator[Act]], ...] = (
    at_speeds,
    tour,
    tour_and_rest,
    two_together,
    idle,
    pumped_low,
    against_valve,
    bucket,
)


def acts_of(site: Site) -> tuple[Act, ...]:
    """All acts that can be done at a site."""
    return tuple(act for row in ACTS for act in row(site))
