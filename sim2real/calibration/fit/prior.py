"""What is known of pumps and mains before a recording is looked at: the datasheets, and how well they hold."""

from dataclasses import dataclass

import numpy as np

from wetwell.protocols.arrays import Floats
from wetwell.sim2real.calibration.fit.main_model import FRICTION, SHIFT

HEAD_SCALE_SD = 0.1
FLOW_SCALE_SD = 0.1
POWER_SCALE_SD = 0.1
"""Standard deviations of head, flow and power of an installed pump over those of its datasheet. [1]

A new pump may miss its curve by 7 % of the head, 9 % of the flow and of the power, ISO 9906:2012, grade 3B, which
catalogues hold to; what has worn may lose 10 to 25 % before it is replaced (US Department of Energy, Pumping Systems
Tip Sheet 4, 2005). 20 % are two of these."""
POWER_SLOPE_SD = 0.1
"""Standard deviation of the power that a pump takes more from no flow to the rated one, over its rated power. [1]"""
SISTERS = 0.5
"""Correlation of these among pumps of one datasheet: half of the variance is that of catalogue, site and meters."""
LIFT_SD_M = 0.5
"""Standard deviation of the lift: levels in drawings, and where the level meter has its zero. [m]"""
FRICTION_SD = 0.5
"""Standard deviation of the friction over that of the file: roughness and fittings are known to some half. [1]"""
FRICTION_HEAD_SHARE = 0.1
"""Friction that is thought possible in any main: what takes this share of its shut-off head at the rated flow. [1]"""
SMALLEST_SCALE = 0.2
"""Scale of head, flow and power of a pump at the least: under it nothing would be a pump. [1]"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prior:
    """Normal distribution of parameters, cut off below.

    Attributes
    ----------
    mean, lowest : (parameters,) arrays
    covariance : (parameters, parameters) array
    """

    mean: Floats
    lowest: Floats
    covariance: Floats

    @property
    def sd(self) -> Floats:
        """(parameters,) standard deviations."""
        deviation: Floats = np.sqrt(np.diag(self.covariance))
        return deviation


def main_prior(curves: Floats, *, friction_h2_m5: float, rated_flow_m3h: float) -> Prior:
    """Prior of the parameters of a `MainModel`.

    Parameters
    ----------
    curves : (pumps, 3) array
        Coefficients of the datasheets. [m, m/(m³/h), m/(m³/h)²]
    friction_h2_m5 : float
        Of the station file. [h²/m⁵]
    rated_flow_m3h : float
        Flow through the pipe in which the friction is, with its pumps at their rated duties. [m³/h]
    """
    pumps = curves.shape[0]
    scales = 2 * pumps
    covariance = np.zeros((scales + 2, scales + 2))
    covariance[:pumps, :pumps] = HEAD_SCALE_SD**2 * _alike(curves)
    covariance[pumps:scales, pumps:scales] = FLOW_SCALE_SD**2 * _alike(curves)
    covariance[SHIFT, SHIFT] = LIFT_SD_M**2
    possible = FRICTION_HEAD_SHARE * float(curves[:, 0].mean()) / rated_flow_m3h**2
    covariance[FRICTION, FRICTION] = max(FRICTION_SD * friction_h2_m5, possible) ** 2
    return Prior(
        mean=np.concatenate([np.ones(scales), [0.0, friction_h2_m5]]),
        lowest=np.concatenate([np.full(scales, SMALLEST_SCALE), [-np.inf, 0.0]]),
        covariance=covariance,
    )


def power_prior(datasheets: Floats) -> Prior:
    """Prior of scale and slope of each pump's power, (2 pumps,): the scales first.

    Parameters
    ----------
    datasheets : (pumps, n) array
        Rows that are equal are pumps of one datasheet.
    """
    pumps = datasheets.shape[0]
    alike, nothing = _alike(datasheets), np.zeros((pumps, pumps))
    return Prior(
        mean=np.repeat([1.0, 0.0], pumps),
        lowest=np.repeat([SMALLEST_SCALE, -np.inf], pumps),
        covariance=np.block([[POWER_SCALE_SD**2 * alike, nothing], [nothing, POWER_SLOPE_SD**2 * alike]]),
    )


def _alike(datasheets: Floats) -> Floats:
    """(pumps, pumps) correlation of what differs from the datasheets."""
    alike = np.all(datasheets[:, None] == datasheets[None], axis=2)
    own = np.eye(datasheets.shape[0], dtype=bool)
    return np.where(own, 1.0, np.where(alike, SISTERS, 0.0))
