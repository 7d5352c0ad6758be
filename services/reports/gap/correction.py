"""The correction on the page of a diagnosis: its equation, and the residuals against what it goes by."""

import numpy as np

from wetwell.services.reports.charts import Series, paragraph, scatter, table
from wetwell.sim2real.correction.wording import COVARIATES_IN_WORDS, name_of
from wetwell.sim2real.diagnosis.correction import Correction
from wetwell.sim2real.diagnosis.diagnosis import Diagnosis
from wetwell.sim2real.residuals.bins import SIGNALS

DRAWN_BINS = 1500
"""Bins that are drawn, spread over the recording."""


def correction_section(correction: Correction, diagnosis: Diagnosis) -> str:
    """HTML of a correction that was taken: a sentence, the equation, sizes, a picture of each thing it goes by."""
    report = correction.report
    low, high = report.shrinkage_ci
    words = [
        paragraph(report.sentence),
        paragraph(f"Equation: {report.equation}"),
        *(
            paragraph(
                f"The recording does not tell it from {one.equation}, which would lie in the "
                f"{one.component.replace('_', ' ')}: both say the same for all that a right model may have wrong."
            )
            for one in report.equivalent
        ),
        paragraph(
            f"On parts of the time that its sizes do not come from it closes {report.shrinkage:.2f} ({low:.2f} to "
            f"{high:.2f}) of the gap. It is in station.toml as an effect named learnt_correction."
        ),
    ]
    rows = [
        [one.covariate, one.shape or "constant", f"{one.size:.4g}", f"{one.ci[0]:.4g} to {one.ci[1]:.4g}", one.unit]
        for one in report.addends
    ]
    sizes = table(["goes by", "shape", "size", "95 % interval", "unit"], rows)
    return "".join([*words, sizes, *_pictures(correction, diagnosis)])


def _pictures(correction: Correction, diagnosis: Diagnosis) -> list[str]:
    """Residuals without and with the correction against each covariate, of the signal that it changes most.

    Of its pump, where it is of one and that pump has the signal.
    """
    learnt, bins, pump = correction.learnt, diagnosis.bins, correction.report.pump - 1
    gain = np.bincount(bins.signal, learnt.before**2 - learnt.after**2, len(SIGNALS))
    signal = int(np.argmax(gain))
    is_own = (bins.signal == signal) & (bins.pump == pump)
    rows = np.flatnonzero(is_own if is_own.any() else bins.signal == signal)
    rows = rows[:: max(rows.size // DRAWN_BINS, 1)]
    found = []
    for atom, part in {
        one.place: (one, part) for one, part in zip(learnt.atoms, learnt.effect.part, strict=True)
    }.values():
        values = learnt.covariates[atom.place][rows]
        unit = COVARIATES_IN_WORDS[part.covariate][1]
        found.append(
            scatter(
                f"residual of the {SIGNALS[signal].replace('_', ' ')} against {name_of(part)}",
                [
                    Series("without the correction", values, learnt.before[rows]),
                    Series("with it", values, learnt.after[rows]),
                ],
                x_label=f"{name_of(part)} in {unit}" if unit else name_of(part),
                y_label="units of noise",
            )
        )
    return found
