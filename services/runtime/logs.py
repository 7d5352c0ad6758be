"""Logs on standard error: for people, or one JSON object a line."""

import json
import logging
import re
import sys

from wetwell.protocols.timestamps import to_iso
from wetwell.services.runtime.settings import LogSettings

_STATION = re.compile(r"station '([^']*)'")
_OWN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}


class JsonFormatter(logging.Formatter):
    """Form of a line: time, level, service, station, message, fields (what was given as `extra`), and a traceback.

    The station is that of `extra`, else the one that the message begins with (`station 'alpha': ...`).

    Examples
    --------
    >>> record = logging.makeLogRecord(
    ...     {"msg": "station '%s': stopped", "args": ("alpha",), "created": 0.0, "levelname": "INFO", "name": "x"})
    >>> line = json.loads(JsonFormatter("detector").format(record))
    >>> line["time"], line["level"], line["service"], line["station"]
    ('1970-01-01T00:00:00Z', 'INFO', 'detector', 'alpha')
    """

    def __init__(self, service: str) -> None:
        super().__init__()
        self._service = service

    def format(self, record: logging.LogRecord) -> str:
        """One line of JSON."""
        message = record.getMessage()
        fields = {name: value for name, value in vars(record).items() if name not in _OWN}
        named = _STATION.match(message)
        line = {
            "time": to_iso(round(record.created * 1000) * 1_000_000),
            "level": record.levelname,
            "service": self._service,
            "station": fields.pop("station", named[1] if named else None),
            "logger": record.name,
            "message": message,
            "fields": fields,
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


def start_logging(settings: LogSettings, service: str) -> None:
    """Log to standard error, one line an event."""
    text = logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s")
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonFormatter(service) if settings.form == "json" else text)
    logging.basicConfig(level=settings.level, handlers=[handler], force=True)
