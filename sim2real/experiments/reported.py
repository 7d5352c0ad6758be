"""What of a proposed act stands in reports and files: plain values, steps that a program can play."""

import math
from typing import TYPE_CHECKING, Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

from wetwell.protocols.orders import Step

if TYPE_CHECKING:  # a reader of reports needs nothing of what weighs acts
    from wetwell.sim2real.experiments.proposals import Proposal, Proposals

Short = Annotated[float, AfterValidator(lambda value: float(f"{value:.6g}"))]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class OrderedStep(_Part):
    """A step of an act; it ends by time or by level, and the next begins.

    Parameters
    ----------
    longest_s : float
        How long it may last. [s]
    speed_ratio : list of float, optional
        Speed of each pump as a share of nominal, 0 to stand; null leaves them to the controller. [1]
    low_m : float, optional
        It ends when the level falls to this; null is no limit. [m]
    high_m : float, optional
        It ends when the level rises to this; null is no limit. [m]
    is_valve_shut : bool
        Whether the valves of the mains are shut meanwhile.
    is_inlet_shut : bool
        Whether the inlet is shut meanwhile.
    """

    longest_s: Short
    speed_ratio: tuple[Short, ...] | None
    low_m: Short | None
    high_m: Short | None
    is_valve_shut: bool
    is_inlet_shut: bool

    @property
    def step(self) -> Step:
        """The step itself."""
        return Step(
            longest_s=self.longest_s,
            speed_ratio=self.speed_ratio,
            low_m=-math.inf if self.low_m is None else self.low_m,
            high_m=math.inf if self.high_m is None else self.high_m,
            is_valve_shut=self.is_valve_shut,
            is_inlet_shut=self.is_inlet_shut,
        )


class ProposedAct(_Part):
    """An act that would tell apart what is left, with what it is expected to bring and to cost.

    Parameters
    ----------
    act : str
        Name of the act.
    sentence : str
        What to do, for those who do it.
    separates : list of list of str
        Sets of effects that it tells from another one, 19 to 1 whichever is the truth.
    information_bits : float
        How much more probable the truth is expected to be, in powers of two. [bit]
    truth_probability : float
        Expected probability of the true set afterwards. [1]
    costs_m3 : float
        Water that is pumped by hand, or held back in the sewer. [m³]
    extra_kwh : float
        Energy beyond what the controller takes for the same water. [kWh]
    crew_h : float
        Hours of all who are needed, ways included. [h]
    length_h : float
        Until the controller is alone again. [h]
    price : float
        Of energy and work, in the currency of `[costs]`.
    steps : list of OrderedStep
        What a program plays.
    """

    act: str
    sentence: str
    separates: tuple[tuple[str, ...], ...]
    information_bits: Short
    truth_probability: Short
    costs_m3: Short
    extra_kwh: Short
    crew_h: Short
    length_h: Short
    price: Short
    steps: tuple[OrderedStep, ...]


class RefusedAct(_Part):
    """An act that may not be done at this station.

    Parameters
    ----------
    act : str
        Name of the act.
    reason : str
        The rule that it would break.
    """

    act: str
    reason: str


def proposed_acts(proposals: "Proposals") -> tuple[ProposedAct, ...]:
    """Acts of proposals, the best first."""
    return tuple(_act(one) for one in proposals.best)


def refused_acts(proposals: "Proposals") -> tuple[RefusedAct, ...]:
    """Acts that are ruled out."""
    return tuple(RefusedAct(act=one.act.name, reason=one.reason) for one in proposals.refused)


def _act(proposal: "Proposal") -> ProposedAct:
    return ProposedAct(
        act=proposal.act.name,
        sentence=proposal.act.sentence,
        separates=proposal.separates,
        information_bits=proposal.information_bits,
        truth_probability=proposal.truth_probability,
        costs_m3=proposal.moved_m3,
        extra_kwh=proposal.extra_kwh,
        crew_h=proposal.crew_h,
        length_h=proposal.length_h,
        price=proposal.price,
        steps=tuple(
            OrderedStep(
                longest_s=step.longest_s,
                speed_ratio=step.speed_ratio,
                low_m=step.low_m if math.isfinite(step.low_m) else None,
                high_m=step.high_m if math.isfinite(step.high_m) else None,
                is_valve_shut=step.is_valve_shut,
                is_inlet_shut=step.is_inlet_shut,
            )
            for step in proposal.act.steps
        ),
    )
