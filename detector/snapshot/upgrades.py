"""Snapshots of older versions, taken over form by form: what was learnt goes on, what was going on begins anew."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.sensors.missing_signals import MissingSignals
from wetwell.detector.statistics.cusum import Cusum
from wetwell.detector.stream.gate import COUNTS, new_gate
from wetwell.detector.stream.run_state import new_pumps
from wetwell.detector.stream.steady_samples import SEGMENT_SAMPLES
from wetwell.detector.stream.stuck_sensors import new_stuck_sensors
from wetwell.protocols.quantities import PUMP_METERS, pump_column

MOVED = ("run_s", "stuck", "rolling")
"""Of a pump in form 1: kept in arrays now, where it goes on."""


def from_1(encoded: Any, datasheet: Datasheet) -> Any:
    """Form 2 of a state of form 1, which kept objects where there are arrays now.

    Open runs, the drawdown, the rolling tests and the look within a run begin anew. Arrays that are not set here are
    as before the first sample.
    """
    state = dict(encoded["dict"])
    gate, pumps, sensors = new_gate(), new_pumps(datasheet), new_stuck_sensors(datasheet.pumps)
    _fill_gate(gate, _fields(state["_gate"]), state["_seen_s"])
    _fill_sensors(sensors, _fields(state["_repeats"]))
    for number, fields in enumerate(map(_fields, state["_pumps"])):
        pumps["is_learning"][number] = fields["known"] is None
        pumps["run_s"][number] = fields["run_s"]
        for name in MOVED:
            del fields[name]
        fields |= {"early": None, "cusum": Cusum(), "blind": MissingSignals()}
    for name, fields in _objects([state["_pumps"]]):
        if name == "Baseline":
            fields["segment_samples"] = SEGMENT_SAMPLES  # of all segments of form 1
        elif name == "Segments":
            fields["samples"] = SEGMENT_SAMPLES
    arrays = [["gate", gate], ["pumps", pumps], ["meters", sensors]]
    return {"dict": [["arrays", {"dict": arrays}], ["system", state["_system"]], ["pumps", state["_pumps"]]]}


UPGRADES: Mapping[int, Callable[[Any, Datasheet], Any]] = {1: from_1}
"""By the form that each begins with."""


def _fields(encoded: Any) -> dict[str, Any]:
    fields: dict[str, Any] = encoded["object"][1]
    return fields


def _objects(encoded: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and fields of all objects in what is encoded."""
    if isinstance(encoded, dict):
        if "object" in encoded:
            yield tuple(encoded["object"])
        encoded = list(encoded.values())
    if isinstance(encoded, list):
        for part in encoded:
            yield from _objects(part)


def _fill_gate(gate: Any, fields: Mapping[str, Any], seen_s: float) -> None:
    if fields["_last_ns"] is not None:
        gate["is_begun"], gate["time_ns"], gate["seq"] = 1, fields["_last_ns"], fields["_last_seq"]
    gate["seen_s"] = seen_s
    for name, count in fields["counts"]["counter"]:
        if name in COUNTS:
            gate[name] = count


def _fill_sensors(sensors: Any, fields: Mapping[str, Any]) -> None:
    """Keep for how long each reading repeated itself while it was learnt."""
    pumps = (len(sensors) - 1) // len(PUMP_METERS)
    names = ["level_m", *(pump_column(pump, name) for pump in range(1, pumps + 1) for name in PUMP_METERS)]
    longest_ns = dict(fields["longest_ns"]["dict"])
    sensors["longest_ns"] = [longest_ns.get(name, 0) for name in names]
