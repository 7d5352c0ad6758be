"""What one checkout does for a comparison: steps from standard input, each in a process of its own.

`compare_checkouts.py` runs this file with the Python of each checkout. A step is a JSON line with its folder, its
name, and either arguments of the command `wetwell` or an act of this file; it leaves files in the folder, beside them
`NAME.stdout`, `NAME.stderr` and `NAME.exit`. Modules lie elsewhere in the two checkouts: an act asks for a name and
finds the module that defines it.
"""

import contextlib
import importlib
import io
import json
import os
import pkgutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv
import pyarrow.parquet

PACKAGES = ("protocols", "simulator", "detector", "sim2real", "services")
STEP_S = 1500
"""Most time of a step."""
WARM = (
    ("simulate", "--station", "alpha", "--days", ".02", "--out", "warm.csv"),
    ("detect", "--station", "alpha", "--recording", "warm.csv", "--out", "warm.jsonl"),
)
"""Commands that load what is compiled before the first step."""


def modules(packages: tuple[str, ...]) -> Iterator[str]:
    """Names of all modules of some packages."""
    for package in packages:
        there = importlib.import_module(f"wetwell.{package}")
        yield there.__name__
        for found in pkgutil.walk_packages(there.__path__, f"{there.__name__}."):
            if not found.name.endswith("__main__"):
                yield found.name


def find(package: str, *names: str) -> Any:
    """What a package defines under one of some names, wherever it lies: the first of them that there is."""
    for name in names:
        for module in map(importlib.import_module, modules((package,))):
            found = vars(module).get(name)
            if found is not None and getattr(found, "__module__", None) == module.__name__:
                return found
    raise LookupError(f"wetwell.{package}: no {' or '.join(names)}")


def read_table(path: str) -> pa.Table:
    """Rows of a recording."""
    return pa.parquet.read_table(path) if path.endswith(".parquet") else pa.csv.read_csv(path)


def derive(source: str, target: str, how: dict[str, Any]) -> None:
    """Another recording of the same plant: thinned, with holes, out of order or without some columns."""
    table = read_table(source)
    names = [name for name in table.column_names if not any(part in name for part in how.get("without", []))]
    table = table.select(names).slice(how.get("skip", 0), how.get("rows"))
    table = table.take(np.arange(0, len(table), how.get("every", 1)))
    rng = np.random.default_rng(how.get("seed", 1))
    if share := how.get("missing"):
        for number, name in enumerate(table.column_names):
            if name != "time" and not name.startswith("truth_"):
                holes = pa.array(rng.random(len(table)) < share)
                values = pa.compute.if_else(holes, pa.scalar(None, pa.float64()), table[name])
                table = table.set_column(number, name, values)
    if how.get("is_disordered"):
        rows = np.arange(len(table)).repeat(1 + (rng.random(len(table)) < 0.01))
        late = np.flatnonzero(rng.random(len(rows)) < 0.01)
        rows[late] = rows[np.maximum(late - 5, 0)]
        table = table.take(rows)
    if gap := how.get("gap"):
        table = table.take(np.r_[0 : gap[0], gap[1] : len(table)])
    if target.endswith(".parquet"):
        pa.parquet.write_table(table, target)
    else:
        pa.csv.write_csv(table, target)


def judge(station: str, source: str, begin: int, states: list[int], name: str) -> None:
    """Verdicts sample by sample from a row on; the detector's state is written at some rows, and at the end."""
    detector, rows = detector_of(station), rows_of(source)
    if begin:
        detector.restore(Path(f"../../old/{Path.cwd().name}/{name}-{begin}.snapshot").read_bytes())
    kept = Path(f"{name}-from-{begin}.jsonl").open("wb")  # noqa: SIM115 - closed at the end of the process
    for row, sample in enumerate(rows):
        if row < begin:
            continue
        if row in states:
            Path(f"{name}-{row}.snapshot").write_bytes(detector.snapshot())
        kept.writelines(verdict.encode() + b"\n" for verdict in detector.update(sample))
    kept.writelines(verdict.encode() + b"\n" for verdict in detector.finish())
    kept.close()
    Path(f"{name}-from-{begin}-end.snapshot").write_bytes(detector.snapshot())
    Path(f"{name}-from-{begin}.counts").write_text(json.dumps(detector.counts))


def detector_of(station: str) -> Any:
    """The streaming detector of a station."""
    plant = find("services", "find_station")(station)
    return find("detector", "Detector")(plant.name, find("detector", "datasheet_of", "nominal_of")(plant))


def rows_of(source: str) -> Iterator[Any]:
    """Samples of a recording."""
    return find("protocols", "read_recording")(Path(source)).rows()


def checkpoint(station: str, source: str, rows: int) -> None:
    """The state file of the detector's service: written, and that of the old checkout read."""
    name = find("services", "find_station")(station).name
    kept, told = find("services", "checkpoint_in", "Checkpoint"), find("services", "Told")
    detector, samples = detector_of(station), rows_of(source)
    verdicts = [verdict for _ in range(rows) for verdict in detector.update(next(samples))]
    Path("state").mkdir(exist_ok=True)
    kept(Path("state"), name).save(detector, told({"order-1": verdicts[0]}, verdicts[-3:]))
    again = detector_of(station)
    answer = kept(Path(f"../../old/{Path.cwd().name}/state"), name).restore(again)
    Path("restored.snapshot").write_bytes(again.snapshot())
    Path("restored.json").write_bytes(b"\n".join(verdict.encode() for verdict in answer.verdicts))


def alarm_state(state: dict[str, Any]) -> None:
    """The state file of the alarms: read, and written again where it was not refused."""
    Path("state").mkdir(exist_ok=True)
    Path("state/alarms.json").write_text(json.dumps(state))
    file = find("services", "site_in", "StateFile")(Path("state"))
    if (kept := file.load()) is not None:
        file.save(kept)


def messages(station: str, source: str) -> None:
    """Payloads of samples one by one and in blocks, there and back; those of other messages as they come back."""
    name = find("services", "find_station")(station).name
    recording = find("protocols", "read_recording")(Path(source))
    kind, block = find("protocols", "Sample"), find("protocols", "SampleBlock")
    samples = [sample for sample, _ in zip(recording.samples(name, first_seq=7), range(600), strict=False)]
    payloads = [sample.encode() for sample in samples]
    blocks = [block.of(samples[at : at + 10]).encode() for at in range(0, 600, 10)]
    Path("samples.jsonl").write_bytes(b"\n".join(payloads))
    Path("blocks.jsonl").write_bytes(b"\n".join(blocks))
    again = [kind.decode(payload).encode() for payload in payloads] + [block.decode(one).encode() for one in blocks]
    Path("again.jsonl").write_bytes(b"\n".join(again))
    verdict = find("protocols", "Verdict")
    told = [verdict.decode(line).encode() for line in Path("verdicts.jsonl").read_bytes().splitlines()]
    Path("verdicts-again.jsonl").write_bytes(b"\n".join(told))
    faults = []
    for kind_of in (kind, block, verdict, find("protocols", "Order"), find("protocols", "Status")):
        for payload in (b"{}", b"x", payloads[0][:40], payloads[0].replace(b'"seq":', b'"seq":-'), blocks[0][:-1]):
            try:
                faults.append(kind_of.decode(payload).encode().decode())
            except ValueError as error:
                faults.append(str(error))
            except Exception as error:  # noqa: BLE001 - what is raised is what is compared
                faults.append(f"{type(error).__name__}: {error}")
    Path("faults.txt").write_text("\n".join(faults))


ACTS: dict[str, Callable[..., None]] = {
    "derive": derive,
    "judge": judge,
    "checkpoint": checkpoint,
    "alarm_state": alarm_state,
    "messages": messages,
}


def run(step: dict[str, Any]) -> int:
    """Run a step in this process."""
    if "act" in step:
        ACTS[step["act"]](*step["arguments"])
        return 0
    sys.argv = ["wetwell", *step["arguments"]]
    try:
        importlib.import_module("wetwell.services.cli").main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def step_in_process(step: dict[str, Any]) -> None:
    """Run a step in a process of its own, with its streams in files."""
    folder = Path(step["folder"])
    folder.mkdir(parents=True, exist_ok=True)
    child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        (folder / f"{step['name']}.exit").write_text(str(os.waitstatus_to_exitcode(status)))
        return
    code = 70
    try:
        signal.alarm(STEP_S)
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for number, stream in ((1, "stdout"), (2, "stderr")):
            os.dup2(os.open(f"{step['name']}.{stream}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
        code = run(step)
    except BaseException:  # noqa: BLE001 - the process ends here, whatever came
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def main() -> None:
    """Answer each line with one; steps find all modules imported."""
    for name in modules(PACKAGES):
        importlib.import_module(name)
    words = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as room,
        contextlib.chdir(room),
        contextlib.redirect_stdout(words),
        contextlib.redirect_stderr(words),
    ):
        for arguments in WARM:
            run({"arguments": arguments})
    for line in sys.stdin:
        step_in_process(json.loads(line))
        print("done", flush=True)


if __name__ == "__main__":
    main()
