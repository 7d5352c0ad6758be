"""Which further effect is taken."""

from types import SimpleNamespace

import numpy as np
import pytest

from wetwell.sim2real.attribution import Attributor, Ranked
from wetwell.sim2real.bins import FLOW
from wetwell.sim2real.fitting import Fit


@pytest.mark.parametrize(
    ("further", "taken"), [({"best", "own"}, "best"), ({"own"}, "own"), ({"best"}, "best"), (set(), "first")]
)
def test_the_best_further_effect_comes_before_one_with_cells_of_its_own(monkeypatch, further, taken):
    ranked = {
        name: Ranked(
            fit=Fit(candidates=(), places=(), residuals=np.full(4, value)), gain=1.0, score=1.0, by_cycle=np.ones(1)
        )
        for name, value in (("first", 5.0), ("best", 1.0), ("own", 2.0))
    }
    ours = Attributor.__new__(Attributor)
    ours.held = np.ones(4, dtype=bool)
    ours._misfit = SimpleNamespace(bins=SimpleNamespace(floor=np.zeros(4)))
    for name, instead in {
        "_left": lambda fit: fit.residuals,
        "_open": lambda _: {FLOW},
        "_joined": lambda current, _: [ranked["best"], ranked["own"]] if current is ranked["first"] else [],
        "_is_own": lambda gains, _: bool(gains[0] == 5.0**2 - 2.0**2),
        "_is_further": lambda one, *_: any(one is ranked[name] for name in further),
        "_swapped": lambda one, _: one,
    }.items():
        monkeypatch.setattr(ours, name, instead)
    assert ours._extend(ranked["first"], []) is ranked[taken]
