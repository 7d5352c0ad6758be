"""Files of other origins turned into recordings, one module an origin."""

from collections.abc import Callable
from pathlib import Path

from wetwell.protocols.recordings.importers.skab import read_skab
from wetwell.protocols.recordings.recording import Recording

IMPORTERS: dict[str, Callable[[Path], Recording]] = {"skab": read_skab}
