"""How the commands of each page are run: what it takes for granted, what goes on meanwhile, what is left out."""

from collections.abc import Mapping
from dataclasses import dataclass, field

STATION = 'cp "$ROOT"/simulator/stations/alpha.toml my-station.toml'
TAKEN_AS_A_FIELD_WOULD = """\
wetwell simulate --station my-station.toml --scenario nominal --days 1 --seed 3 --out field.parquet
python - <<'PYTHON'
from wetwell.protocols.recordings.recording import read_recording, write_recording
from dataclasses import replace
from pathlib import Path
taken = read_recording(Path("field.parquet"))
columns = dict(taken.columns)
columns["pump1_flow_m3h"] = columns["pump1_flow_m3h"] / 3.6
write_recording(replace(taken, columns=columns, truth={}), Path("field.csv"))
PYTHON"""


@dataclass(frozen=True)
class Walk:
    """Pages whose commands are run one after the other, in one folder, and then their Python.

    Attributes
    ----------
    pages : tuple of str
        Under the root of the project.
    given : str
        Shell lines before the first command: files that the pages take for granted.
    before : tuple of str
        Services that the pages take for granted.
    services : tuple of str
        Beginnings of commands that go on until the end of the walk.
    patient : tuple of str
        Beginnings of commands that are tried until they succeed, since they ask for what is yet to come.
    changed : mapping
        Texts that are replaced, so that the walk is short or stays in its folder.
    left_out : mapping
        Beginnings of commands that are not run, with the reason.
    codes : mapping
        Exit codes of commands that do not end with 0, by their beginnings.
    shows_output : bool
        Whether the `text` blocks of the pages are what the commands print, line by line.
    is_long : bool
        Whether `make long` runs it, and not `make check`.
    near : float
        Share by which a figure of these lines may differ from what is printed: of what is weighed, the last digits
        change with each better likelihood. [1]
    """

    pages: tuple[str, ...]
    given: str = ""
    before: tuple[str, ...] = ()
    services: tuple[str, ...] = ()
    patient: tuple[str, ...] = ()
    changed: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    codes: Mapping[str, int] = field(default_factory=dict)
    shows_output: bool = False
    is_long: bool = False
    near: float = 0.0


WALKS = (
    Walk(
        ("README.md",),
        left_out={
            "make up": "is `wetwell up`, which a walk runs",
            "make test": "is what every commit passes",
            "make check": "runs this test",
        },
    ),
    Walk(
        ("docs/python.md",),
        given="""cp "$ROOT"/simulator/stations/alpha.toml north.toml
wetwell simulate --station north.toml --days 0.2 --out north.parquet""",
    ),
    Walk(("docs/add-a-station.md",), services=("wetwell up",), shows_output=True, is_long=True),
    Walk(
        ("docs/tutorial-connect-a-plc.md",),
        services=(
            *("wetwell plc", "wetwell router", "wetwell gateway --plc", "wetwell detector", "wetwell dashboard"),
            "python harbour_plc.py",
        ),
        patient=("wetwell gateway read", "wetwell doctor"),
        codes={"wetwell doctor": 1},  # without historian and alarms it warns
        shows_output=True,
        is_long=True,
    ),
    Walk(
        ("docs/tutorial-first-fault.md", "docs/alarms.md", "docs/grafana.md", "docs/operations.md"),
        given=STATION,
        services=("wetwell up --data first",),
        patient=("wetwell alarms acknowledge", "wetwell history", "wetwell doctor", "curl"),
        changed={  # steady: on a slow machine the story would be told, and the plant stand, before the doctor looks
            "wetwell up --data first": "env WETWELL_HEALTH__HTTP=127.0.0.1:9100 wetwell up --steady --data first"
        },
        left_out={
            "export PATH": "the path of the test leads to wetwell",
            "wetwell alarms --station": "`wetwell up` has started the daemon",
            'wetwell alarms acknowledge pump2.pump_fault --station alpha --by "A. Miller"\n': "done by the tutorial",
            "WETWELL_HEALTH__HTTP=127.0.0.1:9100 wetwell": "`wetwell up` of this walk has it",
            "docker": "needs a container engine",
            "systemctl": "changes the machine; tests/checks/test_operations.py checks the units",
        },
        is_long=True,
    ),
    Walk(
        ("docs/dashboard.md",),
        before=("wetwell router",),
        services=("wetwell dashboard",),
        left_out={"WETWELL_SECURITY__TOKENS_FILE": "opens a port to the network; test_dashboard.py"},
    ),
    Walk(
        ("docs/historian.md",),
        services=("wetwell up",),
        patient=("wetwell history", "wetwell export"),
        left_out={"wetwell historian": "`wetwell up` of this walk has one, and a folder has one"},
        is_long=True,
    ),
    Walk(
        ("docs/command-line.md",),
        left_out={
            "wetwell --install-completion": "changes the shell; "
            "tests/unit/services/commands/test_inputs.py completes words"
        },
    ),
    Walk(("docs/convert.md",), shows_output=True),
    Walk(("docs/tutorial-your-own-export.md",), shows_output=True, near=0.1, is_long=True),
    Walk(("docs/gateway.md",), before=("wetwell plc",), patient=("wetwell gateway read",)),
    Walk(
        ("docs/fleet.md",),
        given="""mkdir -p stations && cp "$ROOT"/simulator/stations/alpha.toml stations/
wetwell dataset --station alpha --out set --count 2 --days 0.5
wetwell simulate --station alpha --days 0.5 --seed 5 --out a.parquet
printf 'station_file,recording\nstations/alpha.toml,a.parquet\n' > table.csv""",
        before=("wetwell router",),
        services=("wetwell fleet --stations stations --shards",),
        changed={
            "--detectors all --out report --scheduler tcp://192.0.2.10:8786": "--detectors wetwell --out report "
            "--scheduler local"
        },
        left_out={
            "wetwell fleet --stations stations.csv": "needs a cluster; "
            "tests/integration/services/fleet/test_fleet.py starts one",
            "WETWELL_DETECTOR__STATE_DIR=state wetwell detector release": "needs a quarantined station; "
            "tests/unit/services/detector/test_quarantine.py",
        },
        is_long=True,
    ),
    Walk(
        ("docs/routers.md",),
        left_out={
            "wetwell router --zenoh tcp/192.0.2.10": "tests/chaos/test_topology.py starts a tree and a ring",
            "WETWELL_ZENOH__UPSTREAM": "as above",
            "wetwell fleet": "as above",
        },
    ),
    Walk(("docs/gap.md",), shows_output=True, near=0.1, is_long=True),
    Walk(("docs/correction.md",), shows_output=True, near=0.1, is_long=True),
    Walk(("docs/experiments.md",), shows_output=True, near=0.2, is_long=True),
    Walk(("docs/gap-watch.md",), shows_output=True, near=0.1, is_long=True),
    Walk(
        ("docs/isolability.md",),
        given="""cp "$ROOT"/simulator/stations/alpha.toml north.toml
wetwell simulate --station north.toml --days 0.2 --seed 3 --out field.csv.gz""",
        is_long=True,
    ),
    Walk(
        ("docs/field-data.md",),
        given=f"""{STATION}
sed -n '/^# preparation.toml/,/^```/p' "$ROOT"/docs/field-data.md | sed '$d' > preparation.toml
{TAKEN_AS_A_FIELD_WOULD}""",
        is_long=True,
    ),
    Walk(
        ("docs/backtest.md",),
        given=f"""{STATION}
wetwell simulate --station my-station.toml --days 0.5 --seed 3 --out a.parquet
wetwell simulate --station my-station.toml --days 0.5 --seed 4 --out b.csv.gz""",
        changed={
            "--seeds 4": "--seeds 1 --detectors wetwell",
            "--count 100": "--count 2 --days 0.5",
            "--detectors all": "--detectors wetwell,paper_f_test",
        },
        is_long=True,
    ),
    Walk(("docs/datasets.md",), changed={"--count 10": "--count 3"}),
    Walk(("docs/security.md",), changed={"/etc/wetwell/": ""}),
    Walk(
        ("docs/deploy.md",),
        given='cp -r "$ROOT"/docker .',
        left_out={
            "make image": "needs a container engine",
            "docker": "needs a container engine",
            "BUILDAH_ISOLATION": "needs a container engine",
        },
    ),
    Walk(
        ("docs/kubernetes.md",),
        left_out={
            "make image": "needs a container engine",
            "kubectl": "needs a cluster",
            "sh docker/kubernetes/secrets.sh": "needs a cluster; tests/checks/test_kubernetes.py runs it",
        },
    ),
)
LEFT_OUT_PAGES = {
    "docs/bridges.md": "needs bridges of others, which are not here; the page says that they were not tried",
    "docs/install.md": "tests/packaging/test_wheel.py installs the wheel by uv pip, uv tool and pipx",
    "docs/trial.md": "takes hours; tests/integration/services/trial/test_trial.py runs short trials",
    "docs/failover.md": "needs a database and several machines; tests/end_to_end/test_failover.py runs pairs",
    "docs/maintenance.md": "needs a crew's visits over days; "
    "tests/integration/services/detector/test_maintenance.py enters acts",
    "docs/real-station.md": "its recording states no licence and is not here; benchmarks/real_station.py reads it",
}
