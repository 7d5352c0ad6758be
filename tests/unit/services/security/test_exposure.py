"""Listening beyond this machine needs protection, or a setting that says that it is wanted open."""

import logging

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.security.exposure import check_exposure

REMEDY = "security.tokens_file"


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "station7"])
def test_an_open_address_is_refused_unless_it_is_wanted(host, caplog):
    with pytest.raises(ConfigError) as raised:
        check_exposure("dashboard", host, is_protected=False, remedy=REMEDY, insecure=False)
    for part in ("dashboard", host, REMEDY, "security.insecure"):
        assert part in str(raised.value)
    with caplog.at_level(logging.WARNING):
        check_exposure("dashboard", host, is_protected=False, remedy=REMEDY, insecure=True)
    (line,) = caplog.messages
    assert line == f"dashboard listens on {host} and lets in everybody who reaches it (security.insecure)"


@pytest.mark.parametrize(("host", "is_protected"), [("127.0.0.1", False), ("[::1]", False), ("0.0.0.0", True)])
def test_loopback_and_what_asks_who_comes_pass_quietly(host, is_protected, caplog):
    check_exposure("dashboard", host, is_protected=is_protected, remedy=REMEDY, insecure=False)
    assert not caplog.messages
