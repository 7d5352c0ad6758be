"""Methods of one's own beside those that come with the package: a class in a file, by `FILE.py:CLASS`."""

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from wetwell.detector.curves.datasheet import Datasheet
from wetwell.detector.evaluation.methods import StreamDetector, detector_class
from wetwell.protocols.errors import ConfigError
from wetwell.services.security.file_sum import file_sum

Method = Callable[[str, Datasheet], StreamDetector]
"""What makes a detector of a station's name and its datasheet curves."""


def method_named(name: str) -> Method:
    """Method that comes with the package under this name, or the class of a file: `my_method.py:MyMethod`.

    Raises
    ------
    ConfigError
        If there is none, its package is missing, or the file cannot be loaded.
    """
    if ".py:" not in name:
        return detector_class(name)
    path, _, attribute = name.rpartition(":")
    found = getattr(_module(Path(path), name), attribute, None)
    if not callable(found):
        raise ConfigError(f"detector '{name}': {path} has no class '{attribute}'")
    made: Method = found
    return made


def method_identity(name: str) -> str:
    """What changes when a method does: its name, and for one of a file also what the file holds."""
    if ".py:" not in name:
        return name
    return f"{name} {file_sum(Path(name.rpartition(':')[0]))}"


def _module(path: Path, name: str) -> Any:
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"detector '{name}': {path} is no Python file")
    module = module_from_spec(spec)
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
    except OSError as error:
        raise ConfigError(f"detector '{name}': {path} cannot be read: {error.strerror}") from error
    except Exception as error:
        raise ConfigError(f"detector '{name}': {path} fails: {type(error).__name__}: {error}") from error
    return module
