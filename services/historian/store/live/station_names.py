"""Which stations a live database has, where a disk has changed the name of one."""

import contextlib
import json
import sqlite3

from wetwell.services.historian.store.live.connection import UNREADABLE
from wetwell.services.historian.store.live.row_checksum import is_event_intact

StationRow = tuple[int, str, int | None, int | None]
"""Number, name, time of the first and last sample. [ns]"""


def station_rows(database: sqlite3.Connection) -> list[StationRow]:
    """Rows of the stations whose names are certain, as far as they can be read.

    SQLite keeps each name twice, in the table and in its index. Where they differ, messages of the station say which
    one it is. No two stations have one name: an index where it stands of several is another one, such as by a page in
    the place of its own, and says nothing. Of a station that only the index has messages must say the same name, and
    its times are not known.

    Parameters
    ----------
    database : sqlite3.Connection
        Its `station` may be a view that knows the columns by places; then `main.station` is the table.
    """
    rows: list[StationRow] = []
    with contextlib.suppress(*UNREADABLE):
        rows.extend(database.execute("SELECT id, name, first_ns, last_ns FROM station"))
    names = _names_in_index(database)
    rows += [(number, "", None, None) for number in names.keys() - {row[0] for row in rows}]
    certain = []
    for number, name, first_ns, last_ns in rows:
        others = names.get(number, set()) - {name}
        told = _name_in_messages(database, number) if others else name
        if isinstance(number, int) and isinstance(told, str) and told in {name, *others}:
            certain.append((number, told, first_ns, last_ns))
    return certain


def _names_in_index(database: sqlite3.Connection) -> dict[int, set[object]]:
    """Names of each number, as far as the index can be read; none if it is not one of names."""
    found: set[tuple[int, object]] = set()
    with contextlib.suppress(*UNREADABLE):
        found.update(database.execute("SELECT id, name FROM main.station INDEXED BY sqlite_autoindex_station_1"))
    names: dict[int, set[object]] = {}
    if len({name for _, name in found}) == len(found):
        for number, name in found:
            names.setdefault(number, set()).add(name)
    return names


def _name_in_messages(database: sqlite3.Connection, number: int) -> object:
    """What an intact message of a station calls it; None if there is none."""
    query = "SELECT kind, station, time_ns, digest, payload, crc FROM event WHERE station = ?"
    with contextlib.suppress(*UNREADABLE):
        for row in database.execute(query, (number,)):
            if is_event_intact(*row):
                with contextlib.suppress(ValueError, TypeError, KeyError):
                    return json.loads(row[4])["station"]
    return None
