"""The address of the database may hold a password: it is shown nowhere."""

from pathlib import Path

import pytest

from wetwell.services.historian.store.interface import Batch, StoreError
from wetwell.services.historian.store.opening import open_store
from wetwell.services.runtime.settings import environment_of, load_settings

URL = "postgresql://wetwell:sesame@127.0.0.1:1/history"


def test_it_is_masked_where_settings_are_shown_and_reaches_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = load_settings(None, {"historian": {"url": URL}})
    assert "sesame" not in settings.model_dump_json() + repr(settings)
    monkeypatch.setenv("WETWELL_HISTORIAN", environment_of(settings)["WETWELL_HISTORIAN"])
    assert load_settings() == settings


def test_an_error_names_host_and_database_only(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("open\n")
    settings = load_settings(None, {"historian": {"url": URL, "password_file": secret}})
    with open_store(settings.historian) as store:
        with pytest.raises(StoreError, match=r"^postgresql 127\.0\.0\.1/history: connection failed") as told:
            store.write(Batch())
        assert "sesame" not in str(told.value)
        secret.unlink()
        with pytest.raises(StoreError, match=r"^historian\.password_file: No such file"):
            store.stations()
