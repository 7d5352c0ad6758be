"""The bill of materials names every pinned package with a hash; the audit tells no answer from a clean one."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ci_module import ci_module

pytestmark = pytest.mark.check

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def audit():
    return ci_module("audit")


def test_the_bill_of_materials_is_valid_and_complete(tmp_path):
    from cyclonedx.schema import SchemaVersion  # noqa: PLC0415 - compiles grammars, in every process that collects
    from cyclonedx.validation.json import JsonStrictValidator  # noqa: PLC0415

    line = re.search(r"cyclonedx-py (requirements .*?)--output-file \$@", (ROOT / "Makefile").read_text(), re.DOTALL)
    assert line is not None
    out = tmp_path / "sbom.json"
    arguments = [*line[1].replace("\\\n", " ").split(), "--output-file", str(out), "--no-validate"]
    command = [sys.executable, "-W", "ignore", "-m", "cyclonedx_py", *arguments]
    subprocess.run(command, check=True, cwd=ROOT, env=os.environ)
    text = out.read_text()
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    bill = json.loads(text)
    requirements = (ROOT / "requirements" / "fleet.txt").read_text()
    pinned = dict(re.findall(r"^([\w.-]+)(?:\[[^\]]*\])?==(\S+)", requirements, re.MULTILINE))
    assert {part["name"]: part["version"] for part in bill["components"]} == pinned
    assert all(part["externalReferences"][0]["hashes"] for part in bill["components"])
    assert bill["metadata"]["component"]["name"] == "wetwell"
    assert "/simple" not in text


def test_every_pin_has_a_hash():
    for name in ("runtime", "fleet", "build", "dev"):
        text = (ROOT / "requirements" / f"{name}.txt").read_text()
        pins = [block for block in re.split(r"\n(?=\S)", text) if "==" in block]
        assert pins
        assert [pin.split()[0] for pin in pins if "--hash=sha256:" not in pin] == []
        assert "://" not in text


def test_an_audit_without_an_answer_is_not_called_clean(audit):
    skipped = {"name": "a", "skip_reason": "not found"}
    clean, bad = {"name": "b", "version": "1", "vulns": []}, {"name": "c", "version": "2", "vulns": []}
    bad["vulns"] = [{"id": "CVE-1", "fix_versions": ["3"]}]
    assert audit.report({"dependencies": [skipped, skipped]}) == (
        0,
        "audit: NOT DONE, the vulnerability service answered for none of 2 packages",
    )
    assert audit.report({"dependencies": [skipped, clean]}) == (
        0,
        "audit: 0 known holes in 1 of 2 packages that the service knows",
    )
    code, text = audit.report({"dependencies": [clean, bad]})
    assert code == 1
    assert "c 2: CVE-1, mended in 3" in text
