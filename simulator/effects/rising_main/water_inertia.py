"""Inertia of the water in the main, and the waves in it."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, MainNumber, limits
from wetwell.simulator.parameters import PlantParameters
from wetwell.simulator.rising_main.waves import MOST_WAVE_S


class WaterInertia(Effect):
    r"""The column of water has to be accelerated and slowed down: as one rigid body, or, in a long main, by waves.

    $$I \frac{dQ}{dt} = H_\text{pump}(Q) - H_s - k Q^2, \quad I = \frac{\ell}{g A},\ Q \ge 0,\ Q \text{ in m³/s};
    \qquad b = \frac{a}{g A} = \frac{2 I}{T}, \quad T = \frac{2 \ell}{a}$$

    The speed is held over each second; the error of the flow's means is under 0.1 m³/h where the water is rigid.

    What a pump does to a long main runs to its end as H + b Q and comes back as H − b Q after T; only then does its
    water move as a whole. The loss lies along the way. Waves are forgotten where the water stands for a second, and
    water does not part where its pressure falls to that of vapour.

    Parameters
    ----------
    inertia_s2_m2 : float
        I, of length ℓ and cross-section A of the main; 300 m of 0.2 m diameter are 973. 0 is no effect. [s²/m²]
    wave_s : float
        T, with the speed a of waves, 1000 m/s in steel and 300 m/s in polyethylene; under two thirds of a
        second, and at 0, the water is rigid. [s]
    main : int
        0 for all.

    References
    ----------
    .. [1] After E. B. Wylie, V. L. Streeter, Fluid Transients in Systems: rigid water column, characteristics.
    """

    component: ClassVar[Component] = "rising_main"
    neutral: ClassVar[dict[str, float]] = {"inertia_s2_m2": 0.0}
    is_everywhere: ClassVar[bool] = True
    reach: ClassVar[dict[str, tuple[float, float]]] = {"inertia_s2_m2": (3.0e4, 30.0)}
    forms: ClassVar[dict[str, tuple[float, ...]]] = {"wave_s": (0.0, 1.0, 3.0, 8.0)}

    name: Literal["water_inertia"] = "water_inertia"
    inertia_s2_m2: Annotated[float, limits(0.0, 1.0e6, "s²/m²")]
    wave_s: Annotated[float, limits(0.0, MOST_WAVE_S, "s")] = 0.0
    main: MainNumber = 0

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Give the water its inertia."""
        return parameters.with_mains(
            lambda main: replace(
                main,
                inertia_s2_m2=main.inertia_s2_m2 + self.inertia_s2_m2,
                wave_s=max(main.wave_s, self.wave_s),
            ),
            self.main,
        )
