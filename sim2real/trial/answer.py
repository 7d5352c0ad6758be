"""What a diagnosis has answered: `report.json`, as far as it is scored."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Number = Annotated[float | None, Field(allow_inf_nan=True)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class Place(_Part):
    """A row of `where`."""

    component: str
    signal: str = ""
    regime: str = ""
    share: Number = None


class Parameter(_Part):
    """A fitted parameter with its interval."""

    value: float | str | int
    ci: tuple[Number, Number] | None = None


class ToldEffect(_Part):
    """An effect that the diagnosis accepts, with those that it cannot tell from it."""

    name: str
    component: str = ""
    equivalent: tuple[str, ...] = ()
    parameters: dict[str, Parameter] = {}


class Candidate(_Part):
    """A row of the ranking, best first."""

    name: str
    score: Number = None
    shrinkage: Number = None


class NotTested(_Part):
    """An effect that the recording cannot show, and why."""

    effect: str
    reason: str = ""


class GivenProbability(_Part):
    """An answer of the posterior: none, unknown, or a set of effects."""

    verdict: Literal["effect", "none", "unknown"]
    effects: tuple[str, ...] = ()
    probability: Annotated[float, Field(ge=0.0, le=1.0)]


class Gap(_Part):
    """Whitened gap before and after, and its floor."""

    before: Number = None
    after: Number = None
    floor: Number = None
    shrinkage: Number = None


class Answer(_Part):
    """A report; keys that are not scored are passed over."""

    verdict: Literal["effect", "none", "unknown"]
    where: tuple[Place, ...] = ()
    effects: tuple[ToldEffect, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    gap: Gap = Gap()
    not_tested: tuple[NotTested, ...] = ()
    posterior: tuple[GivenProbability, ...] = ()

    @property
    def sets(self) -> list[frozenset[str]]:
        """Of each told effect its name and those that it declares equivalent."""
        return [frozenset({effect.name, *effect.equivalent}) for effect in self.effects]

    @property
    def untested(self) -> frozenset[str]:
        """Names of the effects that it says the recording cannot show."""
        return frozenset(row.effect for row in self.not_tested)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects that it tells, strongest first."""
        return tuple(effect.name for effect in self.effects)

    @property
    def ranking(self) -> tuple[str, ...]:
        """Told effects first, then the other candidates, best first, each name once."""
        return tuple(dict.fromkeys((*self.names, *(candidate.name for candidate in self.candidates))))


def answer_of(table: Any) -> Answer:
    """Answer in a parsed report; raises pydantic's ValidationError where it is none."""
    return Answer.model_validate(table)
