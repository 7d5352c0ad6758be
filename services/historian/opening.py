"""The store that the settings name."""

import contextlib
from collections.abc import Iterator

from wetwell.services.historian.folder_store import FolderStore
from wetwell.services.historian.store import Store
from wetwell.services.settings import HistorianSettings


@contextlib.contextmanager
def open_store(settings: HistorianSettings, *, alone: bool = True) -> Iterator[Store]:
    """Open the store; `alone` as the one historian that maintains it.

    Raises
    ------
    StoreError
        If it cannot be opened, or another historian works on it.
    """
    store = FolderStore(
        settings.folder,
        keep_live_days=settings.keep_live_days,
        downsample_after_days=settings.downsample_after_days,
        keep_days=settings.keep_days,
    )
    with contextlib.closing(store), store.alone() if alone else contextlib.nullcontext():
        yield store
