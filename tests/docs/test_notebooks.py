"""The notebooks of the docs run from the top, and say what their texts say."""

import importlib
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SAID = {
    "detection": (
        "<td>pump:2</td><td>pump_fault</td>",
        "<td>main</td><td>system_fault</td>",
        "<svg",
        "'state': 'learning'",
    ),
    "data_sets": ("truth_fault", "'blockage', ", "(51840, 'alpha')"),
    "gap": ("flow_meter_gain: gap ", "{'factor': 1.1", "<svg", "'none'"),
    "own_method": ("<td>wetwell</td>", "<td>three sigma</td>", "<svg"),
}
"""What the outputs of each notebook hold: the claims of its texts."""


@pytest.fixture(scope="module")
def hook():
    sys.path.insert(0, str(ROOT / "docs" / "hooks"))
    return importlib.import_module("notebooks")


def test_every_notebook_is_known_and_kept_without_outputs(hook):
    paths = sorted(hook.NOTEBOOKS.glob("*.ipynb"))
    assert [path.stem for path in paths] == sorted(SAID)
    assert all('"outputs": []' in path.read_text() and '"output_type"' not in path.read_text() for path in paths)


@pytest.mark.check
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("default")  # those of Jupyter are not ours
@pytest.mark.parametrize("name", SAID)
def test_a_notebook_says_what_its_texts_say(name, hook):
    page = hook.notebook_page(hook.run_notebook(hook.NOTEBOOKS / f"{name}.ipynb"))
    code = "".join(page.split("```python")[1:])
    assert [text for text in SAID[name] if text not in code] == []


@pytest.mark.check
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("default")
def test_a_cell_that_fails_is_told(hook, tmp_path):
    book = hook.nbformat.v4.new_notebook(cells=[hook.nbformat.v4.new_code_cell("import wetwell; wetwell.nosuch")])
    path = tmp_path / "wrong.ipynb"
    hook.nbformat.write(book, path)
    with pytest.raises(Exception, match="no attribute 'nosuch'"):
        hook.run_notebook(path)
