"""Energy, volume, run time and starts by hour, from stored samples; days are sums of their hours."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats, Integers
from wetwell.protocols.quantities import pump_column
from wetwell.protocols.recordings.kpi import kpis
from wetwell.services.historian.rows import HOUR_NS
from wetwell.services.historian.samples import Samples

STATION_FIGURES = ("known_h",)
PUMP_FIGURES = ("energy_kwh", "volume_m3", "run_h", "starts")


@dataclass(frozen=True, slots=True, kw_only=True)
class Hours:
    """Figures of the hours of a station.

    Attributes
    ----------
    hour_ns : (n,) int64
        Beginning of each hour, or of each longer span; rising.
    values : (n, 1 + 4 pumps) float64
        `known_h`, then of each pump `energy_kwh`, `volume_m3`, `run_h`, `starts`. NaN where nothing is known.
    """

    hour_ns: Integers
    values: Floats

    def __len__(self) -> int:
        return len(self.hour_ns)

    @classmethod
    def of_rows(cls, rows: list[tuple[int, bytes]]) -> "Hours":
        """Hours of rows (beginning, float64 values) in the order of time."""
        arrays = [np.frombuffer(data, dtype="<f8") for _, data in rows]
        width = max(map(len, arrays), default=1)
        values = [np.pad(array, (0, width - len(array)), constant_values=np.nan) for array in arrays]
        return cls(
            hour_ns=np.array([hour_ns for hour_ns, _ in rows], dtype=np.int64),
            values=np.reshape(values, (len(rows), width)),
        )

    @classmethod
    def of_samples(cls, samples: Samples, start_ns: int, end_ns: int) -> "Hours":
        """Hours that begin from `start_ns` until before `end_ns`; samples around them close the intervals there."""
        if not len(samples):
            return cls.of_rows([])
        figures = kpis(samples.recording())
        of_pumps = [
            figures.hourly_energy_kwh,
            figures.hourly_volume_m3,
            figures.hourly_run_h,
            figures.hourly_starts.astype(np.float64),
        ]
        by_pump = np.stack(of_pumps, axis=1).reshape(-1, figures.hour_ns.size)
        values = np.concatenate([figures.hourly_known_h[None, :], by_pump]).T
        sample_hours = np.unique(samples.time_ns // HOUR_NS * HOUR_NS)
        is_asked = (figures.hour_ns >= start_ns) & (figures.hour_ns < end_ns) & np.isin(figures.hour_ns, sample_hours)
        return cls(hour_ns=figures.hour_ns[is_asked], values=values[is_asked])

    def rows(self) -> list[tuple[int, bytes]]:
        """Rows (beginning, float64 values)."""
        data = np.ascontiguousarray(self.values, dtype="<f8")
        return [(hour_ns, row.tobytes()) for hour_ns, row in zip(self.hour_ns.tolist(), data, strict=True)]

    def over(self, span_ns: int) -> "Hours":
        """Sums over longer spans, such as days."""
        begins_ns = self.hour_ns // span_ns * span_ns
        spans_ns, firsts = np.unique(begins_ns, return_index=True)
        if not len(self):
            return self
        is_known = ~np.isnan(self.values)
        total = np.add.reduceat(np.where(is_known, self.values, 0.0), firsts)
        return Hours(hour_ns=spans_ns, values=np.where(np.add.reduceat(is_known, firsts) > 0, total, np.nan))

    def columns(self) -> dict[str, Floats]:
        """Columns by name; of the station the sums and the energy for each pumped cubic metre."""
        pumps = (self.values.shape[1] - 1) // len(PUMP_FIGURES)
        columns = {"known_h": self.values[:, 0]}
        for number, name in enumerate(PUMP_FIGURES):
            of_pumps = self.values[:, 1 + number :: len(PUMP_FIGURES)]
            for pump in range(pumps):
                columns[pump_column(pump + 1, name)] = of_pumps[:, pump]
            is_known = ~np.isnan(of_pumps).all(axis=1)
            columns[name] = np.where(is_known, np.nansum(of_pumps, axis=1), np.nan)
        has_volume = columns["volume_m3"] > 0.0
        columns["specific_energy_kwh_m3"] = np.where(
            has_volume, columns["energy_kwh"] / np.where(has_volume, columns["volume_m3"], 1.0), np.nan
        )
        return columns


def joined_hours(first: Hours, second: Hours) -> Hours:
    """Hours of two origins together; where both have an hour the second counts."""
    hours = dict(first.rows()) | dict(second.rows())
    return Hours.of_rows(sorted(hours.items()))
