"""Tables of the live database, made by whoever comes first."""

import contextlib
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

from wetwell.services.historian.store.live.schema import VERSION, prepare

AT_ONCE = 8


def test_several_that_make_the_tables_at_once_all_find_them(tmp_path):
    path, together = tmp_path / "live.sqlite", Barrier(AT_ONCE)

    def make(_: int) -> int:
        with contextlib.closing(sqlite3.connect(path, timeout=20)) as database:
            together.wait()
            prepare(database, path, contextlib.nullcontext)
            return int(database.execute("PRAGMA user_version").fetchone()[0])

    with ThreadPoolExecutor(AT_ONCE) as pool:
        assert set(pool.map(make, range(AT_ONCE))) == {VERSION}
