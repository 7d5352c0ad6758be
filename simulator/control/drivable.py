"""Whether the controller of the simulator can drive a station."""

from wetwell.protocols.station.station_file import Station


def check_driven(station: Station) -> None:
    """Refuse a station whose pumps nothing in the simulator may start or stop.

    Raises
    ------
    ValueError
        One line.
    """
    if station.control.is_external:
        raise ValueError(
            f"station '{station.name}': control.mode: 'external': nobody knows when pumps start: replay a recording "
            "of the station instead"
        )
