"""A release is signed with a key of who builds it, and whatever is not what was signed is named."""

import base64
import json
import subprocess
import sys
from pathlib import Path

import pytest
from ci_module import ci_module

ROOT = Path(__file__).parents[2]
DIGEST = "ab" * 32


@pytest.fixture(scope="module")
def provenance():
    return ci_module("provenance")


def keys_in(folder: Path) -> tuple[Path, Path]:
    """Private and public key, made as docs/security.md says."""
    private, public = folder / "release.key", folder / "release.pem"
    subprocess.run(["openssl", "genpkey", "-algorithm", "ed25519", "-out", private], check=True)
    subprocess.run(["openssl", "pkey", "-in", private, "-pubout", "-out", public], check=True)
    return private, public


def test_what_was_signed_is_what_is_there(provenance, tmp_path):
    private, public = keys_in(tmp_path)
    wheel = tmp_path / "wetwell.whl"
    wheel.write_bytes(b"wheel")
    given = provenance.digests_of([wheel], [f"site.example/wetwell@sha256:{DIGEST}"])
    statement = provenance.statement_of(given, "c0ffee", {"requirements/fleet.txt": DIGEST})
    envelope = provenance.signed(statement, private.read_bytes())
    assert provenance.faults(envelope, public.read_bytes(), given) == []
    told = json.loads(base64.b64decode(json.loads(envelope)["payload"]))
    depends = told["predicate"]["buildDefinition"]["resolvedDependencies"]
    assert [next(iter(one["digest"].values())) for one in depends] == ["c0ffee", DIGEST]
    out = tmp_path / "statement.json"
    out.write_bytes(envelope)
    command = [sys.executable, ROOT / ".ci" / "provenance.py", "verify", public, out, wheel]
    assert subprocess.run(command, check=False).returncode == 0
    wheel.write_bytes(b"another wheel")
    assert subprocess.run(command, check=False).returncode == 1


def test_what_is_not_what_was_signed_is_named(provenance, tmp_path):
    private, public = keys_in(tmp_path)
    envelope = provenance.signed(provenance.statement_of({"a.whl": DIGEST}, "c0ffee", {}), private.read_bytes())
    faults = provenance.faults(envelope, public.read_bytes(), {"a.whl": "00" * 32, "b.whl": DIGEST})
    assert faults == ["a.whl: is not what was signed", "b.whl: was not signed"]
    (tmp_path / "other").mkdir()
    _, foreign = keys_in(tmp_path / "other")
    assert provenance.faults(envelope, foreign.read_bytes(), {"a.whl": DIGEST}) == [
        "signature: is not one of this key"
    ]
    table = json.loads(envelope)
    table["payload"] = base64.b64encode(base64.b64decode(table["payload"]).replace(b"a.whl", b"b.whl")).decode()
    forged = provenance.faults(json.dumps(table).encode(), public.read_bytes(), {"b.whl": DIGEST})
    assert forged == ["signature: is not one of this key"]
    assert provenance.faults(b"{}", public.read_bytes(), {"a.whl": DIGEST}) == ["statement: is no envelope of DSSE"]
    with pytest.raises(ValueError, match="must be NAME@sha256:DIGEST"):
        provenance.digests_of([], ["wetwell:latest"])
