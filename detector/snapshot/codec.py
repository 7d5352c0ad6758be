"""The state of a detector as bytes, and back: JSON with a checksum, exact to the last bit."""

import base64
import hashlib
import json
import math
import re
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from types import NoneType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic_core import to_json

from wetwell.detector.baseline.healthy_reference import Check, HealthyReference
from wetwell.detector.baseline.learning import Learning
from wetwell.detector.baseline.model import Baseline, Model
from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.inference.asset_belief import AssetBelief
from wetwell.detector.inference.prior import PumpPrior, SystemPrior
from wetwell.detector.inference.size_track import SizeTrack
from wetwell.detector.pump_memory import PumpMemory
from wetwell.detector.runs.run import Segments
from wetwell.detector.sensors.missing_signals import MissingSignals
from wetwell.detector.snapshot.upgrades import UPGRADES
from wetwell.detector.statistics.cusum import Cusum
from wetwell.detector.stream.steady_samples import STEADY_SAMPLE
from wetwell.detector.verdict.control_limits import ControlLimits
from wetwell.protocols.errors import WetwellError

_SCHEMA_NAME, FORM = "wetwell.detector-snapshot", 2
SCHEMA = f"{_SCHEMA_NAME}/{FORM}"

_CLASSES: Mapping[str, type] = {
    "AssetBelief": AssetBelief,
    "Baseline": Baseline,
    "BlindWatch": MissingSignals,
    "Check": Check,
    "Cusum": Cusum,
    "IndexLimits": ControlLimits,
    "Knowledge": HealthyReference,
    "Learning": Learning,
    "Model": Model,
    "PumpBelief": PumpPrior,
    "PumpRecord": PumpMemory,
    "Segments": Segments,
    "SizeTrack": SizeTrack,
    "SystemBelief": SystemPrior,
}
"""By the names that they bore when form 2 was made."""
_STORED_CLASSES = {cls: name for name, cls in _CLASSES.items()}
_FIELDS: Mapping[str, Mapping[str, str]] = {
    "PumpRecord": {"known": "reference", "belief": "prior", "blind": "missing_signals"},
}
"""Of these classes, by stored name, where the name is another now."""
_ADDED: Mapping[str, Mapping[str, Callable[[], Any]]] = {
    "PumpBelief": {"pump_if_system": lambda: None, "asset": AssetBelief, "shown": SizeTrack},
    "PumpRecord": {"wrong_meters": dict, "sees_flow_of_each": bool},
    "SystemBelief": {"asset": AssetBelief},
}
"""Fields that snapshots of form 2 may lack, and what makes what stands for them then."""
_STORED_FIELDS = {name: {new: old for old, new in fields.items()} for name, fields in _FIELDS.items()}
_DTYPE = re.compile(r"[<>|]?[a-zA-Z]\d+")
_ARRAYS: Mapping[str, str] = {
    "pace": "sampling_period",
    "rows": "steady_samples",
    "meters": "stuck_sensors",
    "blinds": "missing_signals",
}
"""The same of `StreamState`. Steady samples are stored as rows of numbers."""
_STORED_ARRAYS = {new: old for old, new in _ARRAYS.items()}


class SnapshotError(WetwellError):
    """A snapshot is damaged, of another format, or of another station."""


def encode_snapshot(
    station: str,
    datasheet: Datasheet,
    arrays: Mapping[str, npt.NDArray[Any]],
    systems: Sequence[SystemPrior],
    pumps: Sequence[PumpMemory],
) -> bytes:
    """Bytes of a detector's state; the datasheet is not kept, only its fingerprint.

    The prior of a station with one main stands for itself, as in all snapshots from before there were several.
    """
    stored = {_STORED_ARRAYS.get(name, name): array for name, array in arrays.items()}
    stored["rows"] = stored["rows"].view(np.float64).reshape(-1, len(STEADY_SAMPLE.descr))
    system = systems[0] if len(systems) == 1 else list(systems)
    state = {"arrays": stored, "system": system, "pumps": list(pumps)}
    text = to_json(_encoded(state))
    header = {
        "schema": SCHEMA,
        "station": station,
        "datasheet": _fingerprint(datasheet),
        "sha256": hashlib.sha256(text).hexdigest(),
    }
    return b"%b\n%b\n" % (json.dumps(header).encode(), text)


def decode_snapshot(
    data: bytes, station: str, datasheet: Datasheet
) -> tuple[dict[str, npt.NDArray[Any]], list[SystemPrior], list[PumpMemory]]:
    """Arrays, mains and pumps in a snapshot; one of an older form is taken over, see `UPGRADES`.

    Raises
    ------
    SnapshotError
        If it is damaged, of another format or of another station, or if the datasheet curves have changed since.
    """
    try:
        head, _, body = data.partition(b"\n")
        header, text = json.loads(head), body.rstrip(b"\n")
        name, _, number = header["schema"].partition("/")
        form = int(number) if name == _SCHEMA_NAME else 0
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise SnapshotError(f"snapshot of station '{station}': damaged, its first line is no header") from error
    if form != FORM and form not in UPGRADES:
        known = f"format '{header['schema']}', this version reads up to '{SCHEMA}'"
        raise SnapshotError(f"snapshot of station '{station}': {known}")
    if hashlib.sha256(text).hexdigest() != header.get("sha256"):
        raise SnapshotError(f"snapshot of station '{station}': damaged, its checksum differs")
    if header.get("station") != station:
        raise SnapshotError(f"snapshot of station '{header.get('station')}': this is station '{station}'")
    if header.get("datasheet") != _fingerprint(datasheet):
        raise SnapshotError(f"snapshot of station '{station}': the curves in the station file have changed since")
    try:
        encoded = json.loads(text)
        while form < FORM:
            encoded, form = UPGRADES[form](encoded, datasheet), form + 1
        state = _decoded(encoded, datasheet)
        arrays = {_ARRAYS.get(name, name): array for name, array in state["arrays"].items()}
        if "steady_samples" in arrays:
            arrays["steady_samples"] = arrays["steady_samples"].view(STEADY_SAMPLE)[:, 0]
        systems = state["system"] if isinstance(state["system"], list) else [state["system"]]
        _check_counts(systems, state["pumps"], datasheet)
        return arrays, systems, state["pumps"]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise SnapshotError(f"snapshot of station '{station}': not what '{SCHEMA}' holds, {error}") from error


def _check_counts(systems: Sequence[SystemPrior], pumps: Sequence[PumpMemory], datasheet: Datasheet) -> None:
    for name, held, wanted in (
        ("mains", len(systems), len(datasheet.mains)),
        ("pumps", len(pumps), len(datasheet.curves)),
    ):
        if held != wanted:
            raise ValueError(f"{held} {name}, the station has {wanted}")


@cache
def _fingerprint(datasheet: Datasheet) -> str:
    """Hash of a datasheet; of one main with a fixed lift under the names that were there when form 2 was made."""
    text = repr(datasheet)
    if len(datasheet.mains) == 1 and not datasheet.mains[0].level_slope:
        main = datasheet.mains[0]
        text = (
            f"Nominal(curves={datasheet.curves!r}, frequencies_hz={datasheet.frequencies_hz!r}, "
            f"static_head_m={main.static_head_m!r}, friction_h2_m5={main.friction_h2_m5!r}, "
            f"is_common_header={main.is_common_header!r}, area_m2={datasheet.area_m2!r})"
        )
    return hashlib.sha256(text.encode()).hexdigest()


def _encoded(value: Any) -> Any:
    return _encoder_of(value.__class__)(value)


@cache
def _encoder_of(kind: type) -> Callable[[Any], Any]:
    """What encodes values of a class: that of the class or of what it is a kind of, or field by field."""
    for base in kind.__mro__:
        if base in _ENCODERS:
            return _ENCODERS[base]
    if kind not in _STORED_CLASSES:
        raise TypeError(f"a {kind.__name__} cannot be part of a snapshot")
    name = _STORED_CLASSES[kind]
    slots = [slot for base in kind.__mro__ for slot in getattr(base, "__slots__", ())]
    return partial(_encoded_object, name, slots, _STORED_FIELDS.get(name, {}))


def _encoded_object(name: str, slots: Sequence[str], stored: Mapping[str, str], value: object) -> Any:
    fields = {stored.get(field, field): _encoded(getattr(value, field)) for field in slots or vars(value)}
    return {"object": [name, fields]}


def _encoded_float(value: float) -> Any:
    return float(value) if math.isfinite(value) else {"float": str(float(value))}


def _encoded_array(value: npt.NDArray[Any]) -> Any:
    order: Literal["C", "F"] = "C" if value.flags.c_contiguous else "F"
    data = base64.b64encode(value.tobytes(order)).decode()
    return {"array": [_written_dtype(value.dtype), list(value.shape), order, data]}


@cache
def _written_dtype(dtype: np.dtype[Any]) -> Any:
    return dtype.str if dtype.names is None else dtype.descr


def _encoded_pairs(value: Mapping[Any, Any]) -> list[Any]:
    return [[_encoded(key), _encoded(item)] for key, item in value.items()]


def _as_it_is(value: Any) -> Any:
    return value


_ENCODERS: Mapping[type, Callable[[Any], Any]] = {
    **dict.fromkeys((NoneType, bool, int, str), _as_it_is),
    float: _encoded_float,
    np.ndarray: _encoded_array,
    list: lambda value: [_encoded(item) for item in value],
    tuple: lambda value: {"tuple": [_encoded(item) for item in value]},
    frozenset: lambda value: {"frozenset": sorted(value)},
    set: lambda value: {"set": sorted(value)},
    deque: lambda value: {"deque": [value.maxlen, [_encoded(item) for item in value]]},
    Counter: lambda value: {"counter": _encoded_pairs(value)},
    dict: lambda value: {"dict": _encoded_pairs(value)},
    Datasheet: lambda _: {"nominal": None},
}


def _decoded(value: Any, datasheet: Datasheet) -> Any:
    if isinstance(value, list):
        return [_decoded(item, datasheet) for item in value]
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    return _DECODERS[kind](content, datasheet)


def _array(content: list[Any], _datasheet: Datasheet) -> Any:
    dtype, shape, order, data = content
    dtype = _dtype(dtype) if isinstance(dtype, str) else [(name, _dtype(kind)) for name, kind in dtype]
    return np.frombuffer(base64.b64decode(data), dtype=dtype).reshape(shape, order=order).copy(order)


def _dtype(text: str) -> str:
    """A type of numbers as `dtype.str` writes it: numpy takes any other text for Python, and fails as that does."""
    if not _DTYPE.fullmatch(text):
        raise ValueError(f"'{text}' is no type of an array")
    return text


def _object(content: list[Any], datasheet: Datasheet) -> Any:
    name, stored = content
    fields = {_FIELDS.get(name, {}).get(field, field): value for field, value in stored.items()}
    lacking = getattr(_CLASSES[name], "__dataclass_fields__", {}).keys() - fields.keys() - _ADDED.get(name, {}).keys()
    if lacking:
        raise ValueError(f"a {name} without {', '.join(sorted(lacking))}")
    made: Any = object.__new__(_CLASSES[name])
    for field, make in _ADDED.get(name, {}).items():
        object.__setattr__(made, field, make())
    for field, value in fields.items():
        object.__setattr__(made, field, _decoded(value, datasheet))
    return made


def _pairs(content: list[Any], datasheet: Datasheet) -> dict[Any, Any]:
    return {_decoded(key, datasheet): _decoded(item, datasheet) for key, item in content}


_DECODERS: Mapping[str, Callable[[Any, Datasheet], Any]] = {
    "float": lambda content, _: float(content),
    "array": _array,
    "tuple": lambda content, datasheet: tuple(_decoded(content, datasheet)),
    "frozenset": lambda content, datasheet: frozenset(_decoded(content, datasheet)),
    "set": lambda content, datasheet: set(_decoded(content, datasheet)),
    "deque": lambda content, datasheet: deque(_decoded(content[1], datasheet), maxlen=content[0]),
    "counter": lambda content, datasheet: Counter(_pairs(content, datasheet)),
    "dict": _pairs,
    "nominal": lambda _, datasheet: datasheet,
    "object": _object,
}
