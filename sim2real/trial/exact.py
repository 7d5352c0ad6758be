"""Whether an answer is the exact set of what is true: nothing missing, and nothing false beside it."""

from collections.abc import Sequence
from itertools import permutations


def is_exact_set(told: Sequence[frozenset[str]], true: Sequence[str]) -> bool:
    """Whether each told effect stands for another true one, by its name or a declared equivalent, and none is left.

    Parameters
    ----------
    told : sequence of sets of str
        Of each told effect its name and those that are declared equivalent.
    true : sequence of str

    Examples
    --------
    >>> wear, slip = frozenset({"pump_wear", "motor_slip"}), frozenset({"ragging"})
    >>> is_exact_set([wear], ["motor_slip"]), is_exact_set([wear, slip], ["motor_slip"])
    (True, False)
    """
    return len(told) == len(true) and has_all(told, true)


def has_all(told: Sequence[frozenset[str]], true: Sequence[str]) -> bool:
    """Whether there is another told effect for each true one."""
    return any(
        all(name in one for name, one in zip(true, chosen, strict=True)) for chosen in permutations(told, len(true))
    )
