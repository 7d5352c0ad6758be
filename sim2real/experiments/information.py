"""What an act is expected to tell of the truth, by the diagnosis' likelihood."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve
from scipy.special import logit, logsumexp, ndtr, rel_entr

from wetwell.protocols.arrays import Floats
from wetwell.protocols.recordings.recording import Recording
from wetwell.protocols.station.station_file import Station
from wetwell.sim2real.attribution.possible import PossibleSet
from wetwell.sim2real.likelihood.cells import Cells, cells_of
from wetwell.sim2real.likelihood.covariance import Form, no_form
from wetwell.sim2real.likelihood.evidence import weighed
from wetwell.sim2real.likelihood.posterior import CREDIBLE
from wetwell.sim2real.likelihood.ways import KNOWN, Ways
from wetwell.sim2real.recording.joining import joined
from wetwell.sim2real.recording.regimes import regimes_of
from wetwell.sim2real.recording.traces import traces_of
from wetwell.sim2real.replay.replay import Replay
from wetwell.sim2real.residuals.conditions import conditions_of
from wetwell.sim2real.residuals.station import StationResiduals
from wetwell.simulator.effects import effects_of

NO_CHANCE = 1e-9
"""Probability that is as good as none. [1]"""
POOR_ALIKE = replace(KNOWN, span=tuple(way for way in KNOWN.span if way.is_poor))
"""What is wrong of a model that is poor in what pumps and cycles share."""


def evidences(
    recordings: Sequence[Recording], station: Station, sets: Sequence[PossibleSet], truth: PossibleSet
) -> Floats:
    r"""(2, sets) logarithm of how probable recordings are together under each set, as far as it is known by now.

    $$\ln p(z \mid S) = -\tfrac12 \left(r^T K^{-1} r + \ln\det K\right), \qquad K = C + \sum_k d_k d_k^T$$

    with the residuals r at the fit, less those of the truth: noise, and what the observer does not follow, tell of no
    set. C is the covariance of the cells, d the changes of the residuals along the directions of the set's spread.
    What pumps and cycles share is in the first row that of a model as good as what is simulated shows, which fits its
    own set too well to show how wrong the simulator is at a plant; in the second row that of a poor one.

    Parameters
    ----------
    recordings : sequence of Recording
        As they are simulated under the truth.
    station : Station
    sets : sequence of PossibleSet
    truth : PossibleSet
        One of them.

    Raises
    ------
    ValueError
        If the recordings show nothing.
    """
    traces = joined([traces_of(recording, station, least_starts=1) for recording in recordings])
    regimes = regimes_of(traces, station)
    replay = Replay(traces, station, effects_of(station))
    plain = replay.run()
    residuals = StationResiduals(traces, station, regimes, plain, replay.doubt)
    if residuals.bins.size == 0:
        raise ValueError("what is recorded shows nothing")
    condition = conditions_of(residuals.bins, traces, station)
    has_inflow = traces.inflow_m3h is not None
    cells = cells_of(residuals.bins, condition, has_inflow=has_inflow, is_each_second=traces.is_each_second)

    def means(effects: Sequence[object]) -> Floats:
        return cells.means(residuals.of(replay.run(effects)))  # type: ignore[arg-type]

    without, shown = means(()), means(truth.effects)
    found = []
    for one in sets:
        best = means(one.effects)
        moved = [means(effects) - best for effects in one.spread]
        signature = np.abs(without - best)
        form = replace(no_form(cells), signature=signature)
        moved_by = np.array([*moved]).reshape(len(moved), best.size).T
        found.append([_log_probability(cells, best - shown, moved_by, form, ways) for ways in (KNOWN, POOR_ALIKE)])
    return np.array(found).T


def _log_probability(cells: Cells, residuals: Floats, moved: Floats, form: Form, ways: Ways) -> float:
    columns = np.column_stack([residuals, moved])
    inner, log = np.zeros((columns.shape[1], columns.shape[1])), 0.0
    for block in cells.blocks:
        rows = block.rows
        likelier, products, _ = weighed(block, columns[rows], residuals[rows], form.chosen(rows), ways)
        inner += products
        log += likelier
    precision, crossed = inner[1:, 1:] + np.eye(moved.shape[1]), inner[1:, 0]
    taken = float(crossed @ solve(precision, crossed, assume_a="pos")) if crossed.size else 0.0
    return log - 0.5 * (float(inner[0, 0]) - taken + float(np.linalg.slogdet(precision)[1]))


def told(probability: Floats, logs: Floats) -> Floats:
    r"""(truths, sets) posterior after an act, by what the truth is.

    $$P'(S \mid T) \propto P(S)\, p(z_T \mid S)$$

    Parameters
    ----------
    probability : (sets,) array
        Before; sums to 1.
    logs : (truths, sets) array
        Logarithm of how probable what the act shows under each truth is, beside what was known.
    """
    weights = np.log(np.maximum(probability, 1e-300)) + logs
    return np.asarray(np.exp(weights - logsumexp(weights, axis=1, keepdims=True)), dtype=np.float64)


def information_bits(probability: Floats, after: Floats) -> float:
    r"""What an act is expected to tell of the truth; under 0 where it misleads. [bit].

    $$I = \sum_T P(T) \log_2 \frac{P'(T \mid T)}{P(T)}$$

    That is the fall of the entropy where what is simulated is as likely as the likelihood says. Where it is not, a
    posterior that is sure of a wrong set tells nothing, however small its entropy.

    Parameters
    ----------
    probability : (sets,) array
    after : (truths, sets) array
        As `told` makes it.

    References
    ----------
    .. [1] J. M. Bernardo, Expected information as expected utility, Annals of Statistics 7, 1979.

    Examples
    --------
    >>> even = np.array([0.5, 0.5])
    >>> information_bits(even, np.eye(2)), information_bits(even, np.full((2, 2), 0.5))
    (1.0, 0.0)
    >>> round(information_bits(even, np.array([[0.99, 0.01], [0.99, 0.01]])), 2)
    -2.33
    """
    return float(0.0 - rel_entr(probability, np.diag(after)).sum() / np.log(2.0))


def resolved_probability(probability: Floats, after: Floats) -> float:
    r"""Probability that the true set has `CREDIBLE` after an act.

    $$\sum_T P(T)\, \Phi\left(\frac{g_T - n_T}{\sqrt{2 g_T}}\right), \quad
    g_T = \operatorname{logit} P'(T \mid T) - \operatorname{logit} P(T), \quad
    n_T = \operatorname{logit} P_c - \operatorname{logit} P(T)$$

    What Gaussian data tell of two sets, the logarithm of their odds, has twice its mean as variance.

    Parameters
    ----------
    probability : (sets,) array
    after : (truths, sets) array
        As `told` makes it, of what is shown without noise.

    Examples
    --------
    >>> even = np.array([0.5, 0.5])
    >>> just = np.array([[0.95, 0.05], [0.05, 0.95]])
    >>> [round(resolved_probability(even, after), 3) for after in (just, np.eye(2))]
    [0.5, 0.997]
    """
    before = logit(np.clip(probability, NO_CHANCE, 1.0 - NO_CHANCE))
    gained = logit(np.clip(np.diag(after), NO_CHANCE, 1.0 - NO_CHANCE)) - before
    spread = np.sqrt(2.0 * np.maximum(gained, NO_CHANCE))
    return float(probability @ ndtr((gained + before - logit(CREDIBLE)) / spread))
