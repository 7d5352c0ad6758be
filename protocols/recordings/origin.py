"""What a recording says of itself beside its columns: its station, and what a stored value stands for.

Parquet has it in its metadata, CSV in a first line such as `# wetwell station=north value=mean`, which programs that
skip comments need not know.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Self, TypeGuard, get_args

StoredValue = Literal["instant", "mean", "held"]
"""The instant of the stamp, the mean of the interval that ends at it, or the last value that was stored."""

MARK = "# wetwell"
"""How the first line of a CSV begins that says where it comes from."""

_METADATA = b"wetwell."


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Station of a recording, if it is known, and what its values stand for."""

    station: str | None = None
    value: StoredValue = "instant"

    @classmethod
    def of_mark(cls, line: str) -> Self:
        """Origin in the first line of a CSV; nothing is said by a line that does not begin with `MARK`.

        Raises
        ------
        ValueError
            If it names a kind of value that there is not.

        Examples
        --------
        >>> Origin.of_mark("# wetwell station=north value=mean")
        Origin(station='north', value='mean')
        """
        return cls._of(dict(re.findall(r"(\w+)=([^\s,]+)", line)) if line.startswith(MARK) else {})

    @classmethod
    def of_metadata(cls, metadata: Mapping[bytes, bytes]) -> Self:
        """Origin in the metadata of a Parquet schema.

        Raises
        ------
        ValueError
            If it names a kind of value that there is not.
        """
        ours = {key.removeprefix(_METADATA): text for key, text in metadata.items() if key.startswith(_METADATA)}
        return cls._of({key.decode(): text.decode() for key, text in ours.items()})

    @classmethod
    def _of(cls, said: Mapping[str, str]) -> Self:
        value = said.get("value", "instant")
        if not _is_stored_value(value):
            raise ValueError(f"value: got '{value}', must be one of {', '.join(get_args(StoredValue))}")
        return cls(station=said.get("station"), value=value)

    def _said(self) -> dict[str, str]:
        """Whatever is not taken for granted."""
        station = {} if self.station is None else {"station": self.station}
        return station if self.value == "instant" else station | {"value": self.value}

    @property
    def mark(self) -> str:
        """First line of a CSV with its end; empty where there is nothing to say."""
        said = self._said()
        return " ".join([MARK, *(f"{key}={text}" for key, text in said.items())]) + "\n" if said else ""

    @property
    def metadata(self) -> dict[bytes, bytes] | None:
        """Metadata of a Parquet schema; None where there is nothing to say."""
        return {_METADATA + key.encode(): text.encode() for key, text in self._said().items()} or None


def _is_stored_value(text: str) -> TypeGuard[StoredValue]:
    return text in get_args(StoredValue)
