"""The audit: one chain from many writers, and a disk that is full."""

import json
import resource
import threading

import pytest

from wetwell.protocols.errors import RecordingError
from wetwell.services.security.audit import Audit, audit_in
from wetwell.services.security.audit_chain import audits_in, broken_lines, is_cut_off


def test_writers_of_one_file_in_turn_and_at_once_make_one_chain(tmp_path):
    first, second = audit_in(tmp_path, "dashboard"), audit_in(tmp_path, "dashboard")
    for number in range(3):
        first.write(0, number=number)
        second.write(0, number=number)
    threads = [
        threading.Thread(target=lambda audit=audit: [audit.write(0, act="login") for _ in range(10)])
        for audit in (first, second, first)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(first.path.read_text().splitlines()) == 36
    assert broken_lines(first.path) == []
    assert not is_cut_off(first.path)


def test_of_a_line_that_does_not_fit_on_the_disk_nothing_stays_and_the_next_one_follows(tmp_path, caplog):
    audit = audit_in(tmp_path, "dashboard")
    audit.write(0, act="login", by="ada")
    whole = audit.path.read_bytes()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 20, before[1]))
    try:
        with pytest.raises(RecordingError, match=r"dashboard-audit\.jsonl: cannot be written: "):
            audit.write(0, act="login", by="bob")
        audit.note(0, act="login", by="eve")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert audit.errors == 2
    assert 'not in the audit: {"act": "login", "by": "eve"}' in caplog.text
    assert audit.path.read_bytes() == whole
    audit.write(0, act="login", by="kim")
    assert broken_lines(audit.path) == []
    assert [json.loads(line)["by"] for line in audit.path.read_text().splitlines()] == ["ada", "kim"]


def test_an_audit_that_is_gone_is_found_by_its_end(tmp_path):
    audit = audit_in(tmp_path, "alarm")
    audit.write(0, act="shelve")
    audit.path.unlink()
    assert audits_in(tmp_path) == [audit.path]
    assert is_cut_off(audit.path)


def test_without_a_folder_acts_are_only_logged(caplog):
    caplog.set_level("INFO")
    Audit(None).write(0, act="login", by="ada")
    assert 'audit: {"time": "1970-01-01T00:00:00Z", "act": "login", "by": "ada"}' in caplog.text
