"""The folder of compiled kernels is named after all that they are made of, so that no test runs a stale one."""

import importlib
import os
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

from wetwell.protocols.jit import Kernel

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocols", "simulator", "detector", "sim2real")


@pytest.fixture(scope="module")
def sources(pytestconfig):
    return pytestconfig.pluginmanager.get_plugin(str(ROOT / "conftest.py")).kernel_sources()


def test_every_compiled_function_is_in_the_name_of_the_folder(sources):
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    names = [".".join(("wetwell", *path.relative_to(ROOT).with_suffix("").parts)) for path in files]
    modules = [importlib.import_module(name.removesuffix(".__init__")) for name in names]
    compiled = {
        Path(value.py_func.__code__.co_filename).resolve()
        for module in modules
        for value in vars(module).values()
        if isinstance(value, (Kernel, Dispatcher))
    }
    assert len(compiled) > 20
    assert compiled <= set(sources)


def test_so_are_the_constants_that_a_compiled_function_holds(sources):
    assert ROOT / "protocols" / "timestamps.py" in sources
    assert ROOT / "services" / "cli.py" not in sources


def test_all_processes_have_the_same_folder():
    assert os.environ["NUMBA_CACHE_DIR"] == numba.config.CACHE_DIR
