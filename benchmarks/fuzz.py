"""Every parser fed with inputs that nobody would send, guided by the code that they reach (atheris, libFuzzer).

    python benchmarks/fuzz.py --inputs 1000000 [--target mapping] [--seed 1]

`fuzz_targets.py` holds the parsers and says what they must not do. Each is a fork of this process, which begins with
inputs as they should be. `findings` holds what broke the rule: the input in hexadecimal, and the last line of the
traceback; exit code 1 if there are any. `edges` is how much code was reached. Needs `pip install atheris` (Linux).
"""

import argparse
import contextlib
import json
import logging
import os
import platform
import re
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

try:
    import atheris
except ImportError:
    sys.exit("atheris is not installed: pip install atheris")

os.environ["NUMBA_DISABLE_JIT"] = "1"  # the compiler does not take code that is instrumented
with atheris.instrument_imports(
    include=["wetwell.protocols", "wetwell.services", "wetwell.detector.snapshot", "pymodbus"]
):
    from fuzz_targets import parsers

    from wetwell.protocols.errors import WetwellError


def fuzz(name: str, folder: Path, inputs: int, seed: int) -> None:
    """Feed one parser in this process, which libFuzzer ends."""
    logging.disable()
    make, seeds = parsers()[name]
    parse = make()
    corpus = folder / "corpus"
    corpus.mkdir()
    for number, data in enumerate(seeds):
        (corpus / str(number)).write_bytes(data)

    def feed(data: bytes) -> None:
        with contextlib.suppress(WetwellError):
            parse(data)

    options = ["-print_final_stats=1", "-len_control=0", f"-artifact_prefix={folder}/"]
    options += [f"-runs={inputs}", f"-seed={seed}"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], feed)
    atheris.Fuzz()


def run(name: str, inputs: int, seed: int) -> dict[str, Any]:
    """Figures of one parser, fed in a fork of this process: what is imported is instrumented once."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "corpus.log"
        child = os.fork()
        if not child:
            with log.open("wb") as file:
                os.dup2(file.fileno(), sys.stdout.fileno())
                os.dup2(file.fileno(), sys.stderr.fileno())
            try:
                fuzz(name, Path(folder), inputs, seed)
            finally:
                traceback.print_exc()
                sys.stderr.flush()
                os._exit(1)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        told = log.read_text(errors="replace")
        crashes = [file for file in Path(folder).iterdir() if file.is_file() and file != log]
        lines = re.findall(r"^(?:Uncaught Python exception.*|\w[\w.]*(?:Error|Exception)\b.*)$", told, re.MULTILINE)
        findings = [
            {"input": file.read_bytes()[:2000].hex(), "error": (lines or [told[-300:]])[-1]} for file in crashes
        ]
        if status and not findings:
            findings = [{"input": "", "error": told[-500:]}]
    executed = re.findall(r"stat::number_of_executed_units: (\d+)", told)
    rate = re.findall(r"stat::average_exec_per_sec: +(\d+)", told)
    edges = re.findall(r"cov: (\d+)", told)
    figures = {
        "inputs": int(executed[-1]) if executed else 0,
        "per_second": int(rate[-1]) if rate else 0,
        "edges": int(edges[-1]) if edges else 0,
        "findings": findings,
    }
    print(f"{name}: {figures['inputs']} inputs, {len(findings)} findings", file=sys.stderr, flush=True)
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000, help="over all targets")
    parser.add_argument("--target", action="append", help="only this one")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    names = arguments.target or list(parsers())
    each = -(-arguments.inputs // len(names))
    about = {"benchmark": "fuzz", "seed": arguments.seed, "python": platform.python_version()}
    figures = {name: run(name, each, arguments.seed) for name in names}
    findings = sum(len(figure["findings"]) for figure in figures.values())
    total = sum(figure["inputs"] for figure in figures.values())
    print(json.dumps(about | {"inputs": total, "findings": findings, "targets": figures}, indent=2))
    sys.exit(findings > 0)


if __name__ == "__main__":
    main()
