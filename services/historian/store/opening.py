"""The store that the settings name."""

import contextlib
from collections.abc import Iterator
from typing import Any

from wetwell.protocols.errors import ConfigError
from wetwell.services.historian.store.interface import Store
from wetwell.services.runtime.settings import HistorianSettings


@contextlib.contextmanager
def open_store(settings: HistorianSettings, *, alone: bool = True, must_exist: bool = False) -> Iterator[Store]:
    """Open the store; `alone` as the one historian that maintains it.

    Raises
    ------
    ConfigError
        If it must exist and does not.
    StoreError
        If it cannot be opened, or another historian works on it.
    """
    store: Store
    lock: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
    limits: dict[str, Any] = {
        "keep_live_days": settings.keep_live_days,
        "downsample_after_days": settings.downsample_after_days,
        "keep_days": settings.keep_days,
    }
    if settings.url is not None:
        from wetwell.services.historian.store.postgres_store import PostgresStore  # noqa: PLC0415 - each site has one

        url = settings.url.get_secret_value()
        store = PostgresStore(url, password_file=settings.password_file, is_alone=alone, **limits)
    else:
        if must_exist and not settings.folder.is_dir():
            raise ConfigError(f"historian.folder: {settings.folder}: there is no history")
        from wetwell.services.historian.store.folder_store import FolderStore  # noqa: PLC0415

        store = folder = FolderStore(settings.folder, **limits)
        lock = folder.at_work() if alone else lock
    with contextlib.closing(store), lock:
        yield store
