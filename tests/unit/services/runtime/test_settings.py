"""Settings: defaults < TOML file < environment < flags, and one line for what is wrong."""

from pathlib import Path

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.runtime.settings import CONFIG_VARIABLE, load_settings


def test_each_source_overrides_the_one_before(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "wetwell.toml"
    file.write_text('[modbus]\nhost = "file"\nport = 1\nunit_id = 2\n')
    assert load_settings().modbus.port == 5020
    settings = load_settings(file)
    assert (settings.modbus.host, settings.modbus.port, settings.modbus.unit_id) == ("file", 1, 2)
    monkeypatch.setenv("WETWELL_MODBUS__PORT", "3")
    monkeypatch.setenv("WETWELL_MODBUS__UNIT_ID", "4")
    settings = load_settings(file, {"modbus": {"unit_id": 5}})
    assert (settings.modbus.host, settings.modbus.port, settings.modbus.unit_id) == ("file", 3, 5)
    assert settings.modbus.word_order == "ABCD"


def test_the_environment_may_name_the_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "wetwell.toml"
    file.write_text("[health]\nperiod_s = 3.0\n")
    monkeypatch.setenv(CONFIG_VARIABLE, str(file))
    assert load_settings().health.period_s == 3.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[modbus]\nport = 70000\n", "modbus.port: got 70000, input should be less than or equal to 65535"),
        ("[nosuch]\n", "nosuch: unknown key"),
        ("[log]\nlevel = 'LOUD'\n", "log.level: got 'LOUD', input should be 'DEBUG', 'INFO', 'WARNING' or 'ERROR'"),
        (
            "[historian]\nkeep_days = 7\ndownsample_after_days = 9\n",
            "historian: keep_live_days < downsample_after_days <",
        ),
        ("[modbus\n", "is not TOML: "),
    ],
)
def test_a_wrong_setting_is_named(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "wetwell.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as raised:
        load_settings(file)
    assert str(raised.value).startswith(f"{file}: {said}")
    assert "\n" not in str(raised.value)
