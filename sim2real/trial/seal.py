"""Seals: the labels of a case with a salt, and the hash that is published before anybody diagnoses.

The labels hold the hashes of the published files, so that neither can be changed afterwards.
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SCHEMA = "wetwell.trial-labels/1"


def labels_text(labels: Mapping[str, Any], salt: str) -> bytes:
    """Content of the sealed file; the salt keeps the hash from being found by trying labels.

    Examples
    --------
    >>> text = labels_text({"kind": "none"}, "00ff")
    >>> opened(text, digest(text))["kind"]
    'none'
    """
    return json.dumps({"schema": SCHEMA, "salt": salt, **labels}, indent=1, sort_keys=True).encode() + b"\n"


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def opened(text: bytes, published: str) -> dict[str, Any]:
    """Labels of a sealed file, if it is the one that was published.

    Raises
    ------
    ValueError
        If its hash is another one.
    """
    if digest(text) != published.strip():
        raise ValueError("is not what was sealed: its SHA-256 differs from the published one")
    labels: dict[str, Any] = json.loads(text)
    return labels
