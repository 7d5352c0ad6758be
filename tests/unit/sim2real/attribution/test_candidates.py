"""Where the search for an effect begins."""

from wetwell.sim2real.attribution.candidates import candidates_of


def test_a_strength_that_is_neutral_by_the_hints_has_no_ladder():
    (sump,) = candidates_of(1, only=["sump_area_profile"])
    names = [free.name for free in sump.free]
    top = names.index("top_factor")
    moved = [ladder[-1][top] != ladder[0][top] for ladder in sump.ladders({})]
    assert any(moved)
    fixed = sump.ladders({"top_factor": 1.0})
    assert len({float(place[top]) for ladder in fixed for place in ladder}) == 1
    assert len(fixed) > 1, "the other strength still has its ladders"
