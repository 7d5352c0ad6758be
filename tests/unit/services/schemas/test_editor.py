"""An editor checks a file by the line that the docs tell to write: here by taplo, which is what such editors run."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from wetwell.services.schemas.registry import schema_named

EXAMPLES = Path(__file__).parents[4] / "services" / "schemas" / "examples"
STATION = """name = "north"
[sump]
area_m2 = 8.0
[[pump]]
curve = [36.0, -0.02333, -1.3333e-4]
"""


def linted(folder: Path, name: str, text: str) -> tuple[int, str]:
    """Exit code of an editor's check of a file with a schema beside it, and what it says."""
    (folder / f"{name}.schema.json").write_text(json.dumps(schema_named(name)))
    file = folder / f"{name}.toml"
    file.write_text(f"#:schema ./{name}.schema.json\n{text}")
    command = [Path(sys.executable).with_name("taplo"), "lint", file]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", ["station", "scenario", "settings", "mapping", "preparation", "plc"])
def test_an_editor_takes_the_example_of_a_file(name, tmp_path):
    code, said = linted(tmp_path, name, (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))
    assert code == 0, said


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("area_m2 = 8.0", "area_m2 = -8.0", "-8.0 is not valid"),
        ("area_m2", "aera_m2", "'aera_m2' was unexpected"),
        ('name = "north"', "", '"name" is a required property'),
        ("[36.0, -0.02333, -1.3333e-4]", '"steep"', "is not valid"),
    ],
)
def test_an_editor_marks_what_is_wrong_in_its_line(right, wrong, said, tmp_path):
    assert linted(tmp_path, "station", STATION)[0] == 0
    code, told = linted(tmp_path, "station", STATION.replace(right, wrong))
    assert code == 1
    assert said in told
    assert "station.toml:" in told
