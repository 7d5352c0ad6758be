"""The notebooks of the docs are kept without outputs; running one tells of a cell that fails."""

import importlib
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def hook():
    sys.path.insert(0, str(ROOT / "docs" / "hooks"))
    return importlib.import_module("notebooks")


def test_every_notebook_is_kept_without_outputs(hook):
    paths = sorted(hook.NOTEBOOKS.glob("*.ipynb"))
    assert all('"outputs": []' in path.read_text() and '"output_type"' not in path.read_text() for path in paths)


@pytest.mark.check
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("default")
def test_a_cell_that_fails_is_told(hook, tmp_path):
    book = hook.nbformat.v4.new_notebook(cells=[hook.nbformat.v4.new_code_cell("import wetwell; wetwell.nosuch")])
    path = tmp_path / "wrong.ipynb"
    hook.nbformat.write(book, path)
    with pytest.raises(Exception, match="no attribute 'nosuch'"):
        hook.run_notebook(path)
