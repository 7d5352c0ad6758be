"""Who owns a role, and until when. Pure: clocks are arguments.

A lease is a row that only compare-and-set changes. Its end is in the time of the server that keeps it. Who holds it
counts on a clock of its own that nobody sets, from before it asked: so it stops before the server thinks it does.
"""

from dataclasses import dataclass, replace

CLOCK_RATIO = 0.99
"""Share of a lease that its holder uses: clocks of machines run apart by less than .1 %, see adjtimex(2), 500 ppm."""


@dataclass(frozen=True, slots=True)
class Lease:
    """A row: who holds a role.

    Attributes
    ----------
    holder : str
        One life of one member.
    token : int
        Counts up by one with each change of the holder; 0 is nobody's.
    since_s, expires_s : float
        Beginning and end, in the time of the server. [s since 1970]
    """

    holder: str = ""
    token: int = 0
    since_s: float = 0.0
    expires_s: float = float("-inf")

    def taken(self, holder: str, now_s: float, ttl_s: float) -> "Lease | None":
        """The lease after somebody has taken it; None while another's stands.

        Examples
        --------
        >>> first = Lease().taken("a", now_s=10.0, ttl_s=2.0)
        >>> first.token, first.taken("b", now_s=11.9, ttl_s=2.0), first.taken("b", now_s=12.0, ttl_s=2.0).token
        (1, None, 2)
        """
        if now_s < self.expires_s:
            return None
        return Lease(holder, self.token + 1, now_s, now_s + ttl_s)

    def renewed(self, token: int, now_s: float, ttl_s: float) -> "Lease | None":
        """The lease after its holder has renewed it; None if it is another's by now.

        One that is over may be renewed as long as nobody has taken it.
        """
        return replace(self, expires_s=max(self.expires_s, now_s + ttl_s)) if token == self.token else None

    def released(self, token: int) -> "Lease | None":
        """The lease after its holder has given it back; None if it is another's by now."""
        return replace(self, expires_s=float("-inf")) if token == self.token else None


@dataclass(frozen=True, slots=True)
class Tenure:
    """What a holder knows of its lease.

    Attributes
    ----------
    token : int
    ends_s : float
        On the member's own clock. [s]
    """

    token: int
    ends_s: float

    @classmethod
    def asked(cls, token: int, asked_s: float, ttl_s: float) -> "Tenure":
        """Tenure by an answer to what was asked at `asked_s` of the member's clock."""
        return cls(token, asked_s + CLOCK_RATIO * ttl_s)

    def is_over(self, now_s: float) -> bool:
        """Whether its holder must not act any more."""
        return now_s >= self.ends_s
