"""What is known of effects before a recording is looked at: how usual each is, and how large. Even by default."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Prior over sets of effects, and over their parameters.

    Attributes
    ----------
    weights : mapping of str to float
        How usual an effect is, relative to others; those that are not named are as usual as the mean. Empty: all
        alike.
    parameters : mapping of str to mapping of str to (float, float)
        Mean and standard deviation of a parameter of an effect, in its unit. What is not named is even over its
        range.

    Examples
    --------
    >>> priors = Priors(weights={"friction_bias": 3.0, "ragging": 1.0})
    >>> round(priors.log_share(("friction_bias",), ("friction_bias", "ragging")), 4)
    -0.2877
    >>> bool(EVEN.log_share(("friction_bias", "ragging"), ("friction_bias", "ragging")) == np.log(1 / 2))
    True
    """

    weights: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)

    def log_share(self, effects: Collection[str], tested: Collection[str]) -> float:
        r"""Logarithm of the share of a set among sets of its size: the geometric mean of those of its effects.

        $$\frac1{|S|} \sum_{e \in S} \ln \frac{w_e}{\sum_t w_t}$$

        Parameters
        ----------
        effects : collection of str
            At least one.
        tested : collection of str
            Effects that the recording can show.
        """
        usual = float(np.mean(list(self.weights.values()))) if self.weights else 1.0
        total = sum(self.weights.get(name, usual) for name in tested)
        return float(np.mean([np.log(self.weights.get(name, usual) / total) for name in effects]))


EVEN = Priors()
"""Nothing is known."""
