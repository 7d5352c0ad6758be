"""What to do next, in words."""

from collections.abc import Sequence

from wetwell.sim2real.experiments.proposals import Proposal
from wetwell.sim2real.likelihood.posterior import Verdict

NAMED = 3
"""Sets that a sentence names."""


def next_experiment(verdict: Verdict, proposals: Sequence[Proposal], components: Sequence[str]) -> str:
    """Advice in one or two sentences: the best act, or what to do where none tells more.

    Parameters
    ----------
    verdict : Verdict
    proposals : sequence of Proposal
        Best first.
    components : sequence of str
        Those in which something unknown may lie.
    """
    if verdict == "unknown":
        return (
            "No effect of the library explains this gap: inspect the "
            f"{' or the '.join(components).replace('_', ' ')} on site, record its signals against an independent "
            "instrument, and add the effect that is found to the library."
        )
    if proposals:
        best = proposals[0]
        sets = [" with ".join(names) or "nothing at all" for names in best.separates[:NAMED]]
        told = f"{', '.join(sets[:-1])} from {sets[-1]}" if len(sets) > 1 else "a little of what is left"
        return f"{best.act.sentence} It tells {told} ({best.information_bits:.2f} bit, costs {best.price:.0f})."
    if verdict == "none":
        return "Nothing to explain: record again after the next change of the station."
    return "Run the simulator with the new station file, and diagnose a recording of another week to confirm it."
