"""Ask the vulnerability service about pinned packages, and say how many it knew: none is no clean bill.

Exit code 0 if none has a known hole or the service did not answer, 1 if one has.
"""

import json
import subprocess
import sys
from typing import Any


def report(findings: dict[str, Any]) -> tuple[int, str]:
    """Exit code and text for what pip-audit has found."""
    packages = findings["dependencies"]
    asked = [package for package in packages if "skip_reason" not in package]
    if not asked:
        return 0, f"audit: NOT DONE, the vulnerability service answered for none of {len(packages)} packages"
    holes = [
        f"{package['name']} {package['version']}: {hole['id']}, mended in {', '.join(hole['fix_versions']) or 'none'}"
        for package in asked
        for hole in package["vulns"]
    ]
    summary = f"audit: {len(holes)} known holes in {len(asked)} of {len(packages)} packages that the service knows"
    return int(bool(holes)), "\n".join([*holes, summary])


def main() -> int:
    """Exit code."""
    command = ["pip-audit", "--require-hashes", "--disable-pip", "--format", "json", "--timeout", "10"]
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-m", command[0].replace("-", "_"), *command[1:], "--requirement", sys.argv[1]],
        check=False,
        capture_output=True,
        text=True,
    )
    try:
        findings = json.loads(done.stdout)
    except json.JSONDecodeError:
        reason = done.stderr.strip().splitlines()[-1:] or ["nothing said"]
        code, text = 0, f"audit: NOT DONE, the vulnerability service did not answer ({reason[0][:200]})"
    else:
        code, text = report(findings)
    print(text)  # noqa: T201
    return code


if __name__ == "__main__":
    sys.exit(main())
