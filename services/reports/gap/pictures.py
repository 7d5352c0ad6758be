"""Pictures of a diagnosis: duties in the plane of head and flow, traces before and after."""

import numpy as np

from wetwell.protocols.arrays import Integers
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.services.reports.charts import Series, line_chart, scatter
from wetwell.services.reports.gap.lead import FULL_SPEED, NAMES_OF
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.recording.traces import Traces
from wetwell.sim2real.replay.replay import Prediction
from wetwell.simulator.effects import effective_parameters, effects_of

SHOWN_S = 1800
SHOWN_ROWS = 60
"""Traces are drawn over so many seconds, and over so many rows at least."""
DRAWN_DUTIES = 300
"""Duties that are drawn, spread over the recording."""
CURVE_POINTS = 40
MARGIN = 1.15
"""Curves go on so far beyond the greatest flow that is drawn."""
UTC = "time, UTC"


def duty_picture(diagnosis: Diagnosis) -> str:
    """Duties of the pump that ran most by itself at full speed, with its curve and that of its main; thinned."""
    traces = diagnosis.traces
    highest_hz = traces.frequency_hz.max()
    runs = (traces.frequency_hz > 0.0) & traces.is_row
    alone = runs & (traces.frequency_hz >= FULL_SPEED * highest_hz) & (runs.sum(axis=0) == 1)
    pump = int(np.argmax(alone.sum(axis=1)))
    seconds = np.flatnonzero(alone[pump])
    seconds = seconds[np.linspace(0, max(seconds.size - 1, 0), min(DRAWN_DUTIES, seconds.size)).astype(np.int64)]
    shown = [
        Series(label, values.signals["flow_m3h"][pump, seconds], values.signals["head_m"][pump, seconds])
        for label, values in _shown(diagnosis)
    ]
    level_m = float(np.nanmedian(traces.level_m[seconds])) if seconds.size else diagnosis.station.middle_level_m
    speed_hz = float(traces.frequency_hz[pump, seconds].max(initial=0.0))
    flows_m3h = np.concatenate([np.asarray(one.x, dtype=np.float64) for one in shown])
    highest_m3h = MARGIN * float(np.nanmax(flows_m3h, initial=0.0))
    plain = _curves(diagnosis.replay.station, pump, speed_hz, level_m, highest_m3h)
    after = _curves(diagnosis.station, pump, speed_hz, level_m, highest_m3h)
    lines = [Series(name, one.x, one.y) for name, one in plain.items()]
    lines += [
        Series(f"{name}, diagnosed", one.x, one.y)
        for name, one in after.items()
        if not np.array_equal(one.y, plain[name].y)
    ]
    return scatter(
        f"Pump {pump + 1} at full speed, running alone: measured, and simulated before and after",
        shown,
        lines=lines,
        x_label="flow in m³/h",
        y_label="head in m",
    )


def _curves(station: Station, pump: int, speed_hz: float, level_m: float, highest_m3h: float) -> dict[str, Series]:
    """Head of the pump at its speed, and head that its main needs for it alone, over the flow."""
    plant = effective_parameters(station)
    own = plant.pumps[pump]
    main = plant.mains[own.main]
    ratio, flow_m3h = speed_hz / own.nominal_frequency_hz, np.linspace(0.0, highest_m3h, CURVE_POINTS)
    head_m = own.c0 * ratio**2 + own.c1 * ratio * flow_m3h + own.c2 * flow_m3h**2
    lost_m = main.static_head_at_m(level_m) + main.friction_m(flow_m3h)
    return {"pump curve": Series("", flow_m3h, head_m), "system curve": Series("", flow_m3h, lost_m)}


def trace_pictures(diagnosis: Diagnosis) -> str:
    """Level, and what is measured at the pump that runs most, around the worst cycle that was held out."""
    traces = diagnosis.traces
    window = _window(diagnosis)
    time_ns = traces.start_ns + NS_PER_S * traces.time_s[window].astype(np.int64)
    pump = int(np.argmax((traces.frequency_hz[:, window] > 0.0).sum(axis=1)))
    shown = _shown(diagnosis)
    told = "measured, and simulated " + " and ".join(label for label, _ in shown[1:])
    levels = [Series(label, time_ns, values.level_m[window]) for label, values in shown]
    charts = [line_chart(f"Level in the wet well: {told}", levels, x_label=UTC, y_label="level in m", is_time=True)]
    for name in traces.signals:
        word, unit = NAMES_OF[name]
        series = [Series(label, time_ns, values.signals[name][pump, window]) for label, values in shown]
        title, label = f"{word.capitalize()} of pump {pump + 1}: {told}", f"{word} in {unit}"
        charts.append(line_chart(title, series, x_label=UTC, y_label=label, is_time=True))
    return "".join(charts)


def _shown(diagnosis: Diagnosis) -> list[tuple[str, Traces | Prediction]]:
    """What was measured, and what the simulator says before and after, by their names in the legends."""
    replay = diagnosis.replay
    shown: list[tuple[str, Traces | Prediction]] = [
        ("measured", diagnosis.traces),
        ("before", replay.run()),
    ]
    added = effects_of(diagnosis.station)[len(replay.own) :]
    return [*shown, ("after", replay.run(added))] if added else shown


def _window(diagnosis: Diagnosis) -> Integers:
    """Seconds, or rows where there are fewer, around the worst cycle."""
    traces, found, bins = diagnosis.traces, diagnosis.attribution, diagnosis.bins
    by_cycle = np.bincount(bins.cycle[found.validation], found.plain[found.validation] ** 2)
    length_s = max(SHOWN_S, round(SHOWN_ROWS * traces.rate_s))
    begin = max(int(np.argmax(diagnosis.regimes.cycle == int(np.argmax(by_cycle)))) - length_s // 6, 0)
    window = np.arange(begin, min(begin + length_s, traces.seconds))
    return window if traces.is_each_second else window[traces.is_row[window]]
