"""What scanners say of units, image and manifests. One that is not here is named: that is no clean bill.

    python .ci/scan.py [FOLDER of hadolint and checkov]

Exit code 0 if no scanner that is here finds anything, 1 if one does.
"""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
WELL = {"OK", "SAFE", "PERFECT"}
"""Words of systemd-analyze for a unit that is held tight; the others are MEDIUM, EXPOSED, UNSAFE and DANGEROUS."""

Report = tuple[int, str]
"""Exit code and text."""


def of_units(text: str) -> Report:
    """What systemd-analyze says, the exposure of each unit from 0 to 10.

    Examples
    --------
    >>> of_units("Overall exposure level for a.service: 1.5 OK")
    (0, 'systemd-analyze: 1 units, exposure at most 1.5 of 10')
    """
    told = re.findall(r"exposure level for (\S+): ([\d.]+) (\w+)", text)
    bad = [
        f"systemd-analyze: {unit}: exposure {level} of 10, {word}" for unit, level, word in told if word not in WELL
    ]
    worst = max((float(level) for _, level, _ in told), default=10.0)
    return int(bool(bad) or not told), "\n".join(
        [*bad, f"systemd-analyze: {len(told)} units, exposure at most {worst:g} of 10"]
    )


def of_manifests(told: dict[str, Any] | list[dict[str, Any]]) -> Report:
    """What checkov says of the files of one kind or of several."""
    kinds = told if isinstance(told, list) else [told]
    bad = [
        f"checkov: {check['check_id']} {check['check_name']}: {check['resource']}"
        for kind in kinds
        for check in kind["results"]["failed_checks"]
    ]
    passed = sum(kind["summary"]["passed"] for kind in kinds)
    return int(bool(bad)), "\n".join([*bad, f"checkov: {passed} of {passed + len(bad)} checks passed"])


def of_dockerfile(text: str) -> Report:
    """What hadolint says: a line a finding."""
    lines = [f"hadolint: {line}" for line in text.splitlines()]
    return int(bool(lines)), "\n".join([*lines, f"hadolint: {len(lines)} findings"])


def asked(command: Sequence[str], folder: str) -> str | None:
    """What a scanner prints; None where it is not here."""
    program = shutil.which(command[0], path=folder) or shutil.which(command[0])
    if program is None:
        return None
    done = subprocess.run([program, *command[1:]], cwd=ROOT, check=False, capture_output=True, text=True)  # noqa: S603
    return done.stdout


def reports(folder: str) -> list[Report]:
    """What each scanner says."""
    units = sorted(str(unit.relative_to(ROOT)) for unit in (ROOT / "services" / "systemd").glob("*.service"))
    scanners = (
        (["systemd-analyze", "--no-pager", "security", "--offline=true", *units], of_units),
        (["hadolint", "docker/Dockerfile"], of_dockerfile),
        (["checkov", "--config-file", ".ci/checkov.yaml"], lambda text: of_manifests(json.loads(text))),
    )
    told = [(command[0], report, asked(command, folder)) for command, report in scanners]
    return [
        (0, f"{name}: NOT DONE, it is not installed") if text is None else report(text) for name, report, text in told
    ]


def main() -> int:
    """Exit code."""
    told = reports(sys.argv[1] if len(sys.argv) > 1 else "")
    print("\n".join(text for _, text in told))  # noqa: T201
    return max(code for code, _ in told)


if __name__ == "__main__":
    sys.exit(main())
