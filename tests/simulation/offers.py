"""When the historian could take what was sent."""

from simulated_site import Site
from windows import MARGIN_S, Way, blocked

NEVER_S = float("-inf")
EVER_S = float("inf")
PARTS = 60
"""More than all that the historian looks through, of which it takes some in each pause."""


def harms_s(site: Site) -> tuple[float, float]:
    """When files of the historian were harmed first and last."""
    at_s = [harm.at_s for harm in site.harms_of("historian")]
    return min(at_s, default=EVER_S), max(at_s, default=NEVER_S)


def commit_s(site: Site) -> float:
    """In which the historian has kept what it was given."""
    return 2.0 * site.settings.historian.commit_s + MARGIN_S


def looked_through_s(site: Site) -> float:
    """In which the historian has looked through all that it keeps, if nothing keeps it from that."""
    return PARTS / site.scrubbed_at_once * site.settings.historian.maintain_s + MARGIN_S


class Offers:
    """When the historian can take what was sent: at once, or anew after its files were harmed.

    It takes anew what publishers keep when it begins, when it has told that something is damaged, and when it has had
    the time to find that. What it took while something was damaged, and not yet told, may be lost with it.

    Parameters
    ----------
    site : Site
    sender : str
    harmed_s : float
        When its files were harmed last.
    until_s : float
        When it must have what it could take.
    """

    def __init__(self, site: Site, sender: str, harmed_s: float, until_s: float = EVER_S) -> None:
        self._until_s = until_s
        self._way = Way(site, sender, "historian", commit_s(site))
        looked_s = looked_through_s(site)
        searched = Way(site, "historian", "historian", looked_s).free_s(harmed_s, site.seconds)
        full = blocked(site.spans, ["machine"], ["full"])
        told = [
            told.at_s
            for told in site.log
            if told.logger.startswith("wetwell.services.historian.store")
            and not any(begin_s <= told.at_s <= end_s for begin_s, end_s in full)
        ]
        self._settled_s = max((at_s for at_s in told if harmed_s <= at_s <= until_s), default=harmed_s)
        self._is_found = not any(until_s <= at_s <= until_s + looked_s for at_s in told)
        begun = [span.end_s for span in site.spans if (span.what, span.name) == ("away", "historian")]
        found = [] if searched is None else [searched + looked_s]
        self._again_s = min((at_s for at_s in [*begun, *told, *found] if at_s >= self._settled_s), default=EVER_S)

    def could_be_kept(self, at_s: float, end_s: float) -> bool:
        """Whether what was sent then, and could be had until the end, could be kept for good."""
        if at_s < self._settled_s:
            return self.was_open(self._again_s, end_s)
        return self._is_found and self.was_open(at_s, end_s)

    def was_open(self, at_s: float, end_s: float) -> bool:
        """Whether it could be kept at all, whatever became of it."""
        return self._way.is_open(at_s, min(end_s, self._until_s))
