"""A method in a file: found by `FILE.py:CLASS`, told in one line where it is wrong, judged anew when changed."""

import json

import pytest

from wetwell.protocols.errors import ConfigError
from wetwell.services.batch.own_methods import method_identity, method_named

METHOD = """from wetwell.detector.evaluation.methods.run_detector import RunDetector


class Calm(RunDetector):
    def learn(self, pump, runs): ...

    def told(self, run):
        return "normal"
"""


def test_the_backtest_takes_a_method_of_a_file_and_judges_anew_when_it_changes(run_wetwell, tmp_path, capsys):
    path = tmp_path / "calm.py"
    path.write_text(METHOD)
    line = ["backtest", "--station", "alpha", "--scenario", "demo", "--days", "0.4", "--workers", 1, "--json"]
    names = f"{path}:Calm,always_normal"
    assert run_wetwell(*line, "--detectors", names, "--out", tmp_path / "report") == 0
    figures = json.loads(capsys.readouterr().out)["detectors"]
    assert figures[f"{path}:Calm"]["confusion"] == figures["always_normal"]["confusion"]
    before = method_identity(f"{path}:Calm")
    path.write_text(METHOD.replace("normal", "unknown"))
    assert method_identity(f"{path}:Calm") != before
    assert method_identity("wetwell") == "wetwell"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (METHOD, "has no class 'Quiet'"),
        ("import nosuch_package", "fails: ModuleNotFoundError: No module named 'nosuch_package'"),
        ("x =", "fails: SyntaxError"),
        (None, "cannot be read: No such file or directory"),
    ],
)
def test_a_file_that_is_wrong_is_told_in_one_line(text, said, tmp_path):
    path = tmp_path / "wrong.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=said) as told:
        method_named(f"{path}:Quiet")
    assert "\n" not in str(told.value)
