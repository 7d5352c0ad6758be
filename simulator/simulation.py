"""A plant that runs a scenario: live seconds and batches of days by the same code."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from wetwell.protocols.arrays import Flags, Floats
from wetwell.protocols.orders import Step
from wetwell.protocols.quantities import INFLOW, LEVEL, PUMP_ANALOGUES, pump_column
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.control import check_levels
from wetwell.protocols.station.station_file import Station
from wetwell.protocols.timestamps import NS_PER_S
from wetwell.simulator.control.drivable import check_driven
from wetwell.simulator.effects import effective_parameters, effects_of
from wetwell.simulator.faults import Fault
from wetwell.simulator.faults.profile import ChannelFault, PumpFault, SensorFault, SystemFault
from wetwell.simulator.forcing import Forcing, healthy_forcing
from wetwell.simulator.plant import Plant
from wetwell.simulator.scenario import DEFAULT_START_NS, Scenario
from wetwell.simulator.state import Truth
from wetwell.simulator.telemetry.channels import channels_of


class Simulation:
    """A station under a scenario, from its first second on.

    The same station, scenario and seed give the same numbers, byte for byte, in whatever blocks they are taken.

    Parameters
    ----------
    station : Station
    scenario : Scenario
    seed : int
        >= 0.
    start_ns : int
        Time of the first sample, where the scenario names none.
    steps : sequence of Step
        What an operator does from the first second on; what was done stands in columns of its own.

    Attributes
    ----------
    station, scenario
        As given.
    start_ns : int
        Time of the first sample.

    Raises
    ------
    ValueError
        If a fault names a pump or main that the station lacks, an effect of the station is not known or wrong,
        or nobody knows when it starts its pumps, the initial level lies under its floor, or a step is not for
        this station.
    """

    def __init__(
        self,
        station: Station,
        scenario: Scenario,
        seed: int,
        start_ns: int = DEFAULT_START_NS,
        steps: Sequence[Step] = (),
    ) -> None:
        check_driven(station)
        self._effects = effects_of(station)
        for number, fault in enumerate(scenario.fault, start=1):
            for part, place, count in (
                ("pump", _pump_of(fault), len(station.pump)),
                ("main", _main_of(fault), len(station.mains)),
            ):
                if place > count:
                    raise ValueError(
                        f"scenario '{scenario.name}': fault[{number}].{part}: got {place}, "
                        f"station '{station.name}' has {count} {part}{'' if count == 1 else 's'}"
                    )
        floor_m = station.sump.floor_level_m
        if scenario.initial_level_m < floor_m:
            raise ValueError(
                f"scenario '{scenario.name}': initial_level_m: got {scenario.initial_level_m:g}, "
                f"the floor of station '{station.name}' is at {floor_m:g}"
            )
        inflow_rng, self._sensor_rng = np.random.default_rng(seed).spawn(2)
        self.station = station
        self.scenario = scenario
        self._inflow = scenario.inflow.stream(inflow_rng)
        parameters = effective_parameters(station)
        self._columns = parameters.columns
        self._plant = Plant(parameters, scenario.initial_level_m, steps)
        self.start_ns = scenario.start_time if scenario.start_time is not None else start_ns

    @property
    def seconds(self) -> int:
        """Seconds simulated so far."""
        return self._plant.seconds

    @property
    def settings(self) -> dict[str, float]:
        """What an operator may change, by register name: start and stop levels, automatic (1) or off (0)."""
        levels = {
            f"{kind}_level{n}_m": float(level_m)
            for kind, levels_m in (
                ("start", self._plant.start_levels_m),
                ("stop", self._plant.stop_levels_m),
            )
            for n, level_m in enumerate(levels_m, start=1)
        }
        automatic = {f"pump{i}_auto": float(flag) for i, flag in enumerate(self._plant.is_automatic, start=1)}
        return levels | automatic

    def change_settings(self, changes: Mapping[str, float]) -> None:
        """Change settings by register name, all or none; they act from the next second on.

        Raises
        ------
        ValueError
            If a name is unknown or the levels would not work together.
        """
        settings = self.settings
        unknown = [name for name in changes if name not in settings]
        if unknown:
            raise ValueError(f"{unknown[0]} is not a setting of station '{self.station.name}'")
        settings |= changes
        count = self._plant.start_levels_m.size
        start_m = tuple(settings[f"start_level{n}_m"] for n in range(1, count + 1))
        stop_m = tuple(settings[f"stop_level{n}_m"] for n in range(1, count + 1))
        check_levels(start_m, stop_m)
        self._plant.start_levels_m[:], self._plant.stop_levels_m[:] = start_m, stop_m
        self._plant.is_automatic[:] = [settings[f"pump{i}_auto"] > 0 for i in range(1, len(self.station.pump) + 1)]

    def advance(self, seconds: int, *, truth: bool = True) -> Recording:
        """Simulate the next seconds.

        Parameters
        ----------
        seconds : int
            Length of the block. [s]
        truth : bool
            Whether to give the truth columns.

        Returns
        -------
        recording : Recording
            One row a second.
        """
        begin = self._plant.seconds
        time_s = np.arange(begin, begin + seconds, dtype=np.float64)
        forcing = healthy_forcing(
            self._inflow.next_seconds(seconds),
            len(self.station.pump),
            len(self.station.mains),
            with_sensors=any(isinstance(fault, SensorFault) for fault in self.scenario.fault),
            clock_s=self.start_ns / NS_PER_S + time_s,
            columns=np.full((len(self._columns), seconds), np.nan),
        )
        for effect in self._effects:
            effect.force(forcing, time_s)
        for fault in self.scenario.fault:
            fault.apply(forcing, time_s)
        measured, true = self._plant.advance(forcing, self._sensor_rng)
        stamps_ns = self.start_ns + NS_PER_S * np.arange(begin, begin + seconds)
        return Recording(
            time_ns=stamps_ns,
            columns=_measured(measured, len(self.station.pump)) | self._plant.orders.columns(true.step),
            truth=self._truth_columns(true, forcing, time_s) if truth else {},
            station=self.station.name,
        )

    def _truth_columns(self, true: Truth, forcing: Forcing, time_s: Floats) -> dict[str, npt.NDArray[Any]]:
        """Truth columns; the state of a pump knows its own faults, those of its main and of the whole station."""
        active = [fault.is_active(time_s) for fault in self.scenario.fault]
        shares = [fault.share(time_s) for fault in self.scenario.fault]
        kinds = [_KINDS.index(next(k for k in _KINDS if isinstance(fault, k))) for fault in self.scenario.fault]
        columns: dict[str, npt.NDArray[Any]] = {
            "truth_state": _state_names(kinds, active, time_s.size),
            "truth_fault": _fault_names([fault.kind for fault in self.scenario.fault], active, time_s.size),
            "truth_severity": _largest(shares, time_s.size),
            "truth_level_m": true.level_m,
            "truth_inflow_m3h": forcing.inflow_m3h,
            "truth_overflow_m3h": true.overflow_m3h,
        }
        for m, (friction, rise_m) in enumerate(zip(forcing.friction_factor, forcing.static_rise_m, strict=True), 1):
            main = f"main{m}_" if len(self.station.mains) > 1 else ""
            columns |= {f"truth_{main}friction_factor": friction, f"truth_{main}static_rise_m": rise_m}
        for i, main_place in enumerate(self.station.main_of_pump):
            felt = [
                k
                for k, fault in enumerate(self.scenario.fault)
                if _pump_of(fault) in {0, i + 1} and _main_of(fault) in {0, main_place + 1}
            ]
            own = [shares[k] for k, fault in enumerate(self.scenario.fault) if _pump_of(fault) == i + 1]
            columns |= {
                f"truth_pump{i + 1}_state": _state_names(
                    [kinds[k] for k in felt], [active[k] for k in felt], time_s.size
                ),
                f"truth_pump{i + 1}_severity": _largest(own, time_s.size),
                f"truth_pump{i + 1}_speed_factor": forcing.speed_factor[i],
                f"truth_pump{i + 1}_flow_m3h": true.flow_m3h[i],
                f"truth_pump{i + 1}_head_m": true.head_m[i],
                f"truth_pump{i + 1}_power_kw": true.power_kw[i],
            }
        return columns


def _measured(measured: Floats, pumps: int) -> dict[str, Floats]:
    columns = {"level_m": measured[LEVEL], "inflow_m3h": measured[INFLOW]}
    channels = {quantity: channels_of(quantity, pumps) for quantity in PUMP_ANALOGUES}
    for i in range(pumps):
        for quantity, of_pumps in channels.items():
            columns[pump_column(i + 1, quantity)] = measured[of_pumps[i]]
        columns[pump_column(i + 1, "running")] = (columns[pump_column(i + 1, "frequency_hz")] > 0).astype(np.float64)
    return columns


_KINDS = (PumpFault, SystemFault, SensorFault)
_STATES = np.array(["normal", "pump_fault", "system_fault", "pump_and_system_fault", "sensor_fault"])
_SENSOR_FAULT = 4


def _pump_of(fault: Fault) -> int:
    """Pump (from 1) that a fault is confined to; 0 where it concerns them all."""
    return fault.pump if isinstance(fault, PumpFault | ChannelFault) else 0


def _main_of(fault: Fault) -> int:
    """Main (from 1) that a fault is confined to; 0 where it concerns them all."""
    return fault.main if isinstance(fault, SystemFault) else 0


def _state_names(kinds: Sequence[int], active: Sequence[Flags], seconds: int) -> npt.NDArray[np.str_]:
    """States by the faults that act, each of one of `_KINDS`; a pump or system fault counts more than a sensor's."""
    if not any(flags.any() for flags in active):
        return np.broadcast_to(_STATES[0], (seconds,))  # a healthy month takes the room of one row
    acts = np.zeros((len(_KINDS), seconds), dtype=np.bool_)
    for kind, flags in zip(kinds, active, strict=True):
        acts[kind] |= flags
    pump, system, sensor = acts
    names: npt.NDArray[np.str_] = _STATES[np.where(pump | system, pump + 2 * system, _SENSOR_FAULT * sensor)]
    return names


def _fault_names(kinds: Sequence[str], active: Sequence[Flags], seconds: int) -> npt.NDArray[np.str_]:
    """Kinds that act, each once, joined by "+"; empty where none does."""
    if not any(flags.any() for flags in active):
        return np.broadcast_to(np.array(""), (seconds,))
    acts = {kind: np.zeros(seconds, dtype=np.bool_) for kind in kinds}
    for kind, flags in zip(kinds, active, strict=True):
        acts[kind] |= flags
    changed = np.zeros(seconds, dtype=np.bool_)
    changed[:1] = True
    for flags in acts.values():
        changed[1:] |= flags[1:] != flags[:-1]
    begins = np.flatnonzero(changed)
    names = ["+".join(kind for kind, flags in acts.items() if flags[begin]) for begin in begins]
    return np.repeat(np.array(names), np.diff(begins, append=seconds))


def _largest(shares: Sequence[Floats], seconds: int) -> Floats:
    """Largest share in each second, 0 without any."""
    return np.maximum.reduce(shares) if shares else np.broadcast_to(0.0, (seconds,))
