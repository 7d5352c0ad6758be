"""What can be told apart at a station, or in a recording of it."""

from collections.abc import Sequence
from pathlib import Path

from wetwell.protocols.errors import ConfigError, RecordingError
from wetwell.protocols.quantities import SensedQuantity
from wetwell.protocols.recordings.reading import PLAIN, Reading
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.isolability.isolability import Isolability, isolability
from wetwell.sim2real.isolability.recorded import recorded_points, recorded_signals
from wetwell.simulator.effects import effective_parameters


def isolability_of(
    station: Station, signals: Sequence[SensedQuantity] | None, recording: Path | None, reading: Reading = PLAIN
) -> Isolability:
    """What can be told apart by signals, or by those of a recording, at the duty points that occur in it.

    Parameters
    ----------
    station : Station
    signals : sequence of quantities, optional
        Default: those of the recording.
    recording : Path, optional
        Default: the duty points that the control reaches.
    reading : Reading
        How the recording is taken up.

    Raises
    ------
    ConfigError
        If there is no pump in service.
    RecordingError
        If the recording cannot be read, is of another station, or has no duty point of the station.
    """
    if recording is None:
        try:
            return isolability(station, signals or ())
        except ValueError as error:
            raise ConfigError(f"station '{station.name}': {error}") from error
    rows = reading.read_of(recording, station)
    try:
        points = recorded_points(rows, station, effective_parameters(station))
        return isolability(station, recorded_signals(rows) if signals is None else signals, points)
    except ValueError as error:
        raise RecordingError(f"{recording}: {error}") from error
