"""Register map of a PLC as CSV, in the form of `wetwell modbus-map`, one row a signal.

Columns `name`, `table`, `address`, `type`; optional `unit`, and for foreign PLCs `scale`, `offset`, `word_order`,
`bit`, `no_value` (numbers with blanks between). `count`, `access` and `description` are for people. Rows of settings
(`start_level1_m`, `pump1_auto`) are left out. Of a signal that is in two tables the first row counts.
"""

import csv
import re
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from wetwell.protocols.errors import ConfigError, first_fault
from wetwell.protocols.modbus.device_signal import Signal, check_signal

_SIGNAL_FIELDS = ("table", "address", "type", "unit", "scale", "offset", "word_order", "bit", "no_value")
_FOR_PEOPLE = {"name", "count", "access", "description"}
_SETTING = re.compile(r"(start|stop)_level\d+_m|pump\d+_auto")


def read_map_csv(path: Path, pumps: int | None) -> dict[str, Signal]:
    """Signals in a CSV file.

    Parameters
    ----------
    path : Path
        The file, in UTF-8.
    pumps : int, optional
        Number of pumps of the station, if it is known.

    Raises
    ------
    ConfigError
        If a rule is broken; one line with file, line, key, value and rule.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file, strict=True)
            columns = set(rows.fieldnames or ())
            if missing := {"name", "table", "address", "type"} - columns:
                raise ConfigError(f"{path}: column '{min(missing)}' is missing")
            if unknown := columns - {*_SIGNAL_FIELDS, *_FOR_PEOPLE}:
                raise ConfigError(f"{path}: column '{min(unknown)}' is not known")
            signals: dict[str, Signal] = {}
            for row in rows:
                place = f"{path}: line {rows.line_num}"
                if not _SETTING.fullmatch(row["name"] or ""):
                    signals.setdefault(row["name"], _signal(row, place, pumps))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path}: is no CSV in UTF-8: {error}") from error
    return signals


def _signal(row: Mapping[str, str | None], place: str, pumps: int | None) -> Signal:
    cells: dict[str, object] = {key: text for key in _SIGNAL_FIELDS if (text := row.get(key))}
    table, numbers = str(cells.get("table")), row.get("no_value")
    if table.isdecimal():
        cells["table"] = int(table)
    if numbers:
        cells["no_value"] = numbers.split()
    name = row["name"] or ""
    try:
        signal = Signal.model_validate(cells)
        check_signal(name, signal, pumps)
    except ValidationError as error:
        raise ConfigError(f"{place}: {name}: {first_fault(error)}") from error
    except ValueError as error:
        raise ConfigError(f"{place}: {error}") from error
    return signal
