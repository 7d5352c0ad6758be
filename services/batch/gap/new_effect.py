"""From the correction of a diagnosis to the files of a new effect: source, test and rows, for a person to finish."""

import re
from pathlib import Path
from string import Template

from wetwell.protocols.atomic_file import atomic_file
from wetwell.protocols.errors import ConfigError
from wetwell.protocols.station.station_file import load_station
from wetwell.sim2real.correction.wording import equation, sentence
from wetwell.simulator.effects import EFFECTS, effects_of
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection
from wetwell.simulator.parameters import plant_parameters

NAME = r"[a-z][a-z0-9_]{2,39}"
_FOLDER_OF = {"sump": "wet_well", "rising_main": "rising_main", "pump": "pump", "drive": "drive"}
"""Folders of effects by component; those of sensors lie in that of telemetry."""

_SOURCE = Template('''"""$summary"""

from typing import Annotated, ClassVar, Literal

from wetwell.simulator.effects.effect import Component, Effect, limits
from wetwell.simulator.effects.station.correction_part import PartTable
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection
from wetwell.simulator.parameters import PlantParameters


class $cls(Effect):
    r"""$summary

    $$$$\\text{$equation}$$$$

    Learnt from a recording of station $station: put the physics in the place of its shapes.

    Parameters
    ----------
$described

    References
    ----------
    .. [1] None yet: the equation was learnt. Name the source of its physics.
    """

    component: ClassVar[Component] = "$component"
    neutral: ClassVar[dict[str, float]] = {$neutral}

    name: Literal["$name"] = "$name"
$fields

    def modify(self, parameters: PlantParameters) -> PlantParameters:
        """Correct the term."""
        parts = ($parts)
        learnt = LearntCorrection(term="$term", offset=self.offset, part=parts, pump=$pump, main=$main)
        return learnt.modify(parameters)
''')
_TEST = Template('''"""The effect does nothing at its neutral values, and with its own what was learnt."""

import importlib.util
from pathlib import Path

from wetwell.protocols.station.station_file import Station
from wetwell.simulator.effects.station.learnt_correction import LearntCorrection
from wetwell.simulator.parameters import plant_parameters

SPEC = importlib.util.spec_from_file_location("$name", Path(__file__).with_name("$name.py"))
MODULE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MODULE)
LEARNT = LearntCorrection.model_validate_json("""$learnt""")
STATION = Station.model_validate_json("""$plant""")


def test_neutral_values_change_nothing():
    plant = plant_parameters(STATION)
    effect = MODULE.$cls(**MODULE.$cls.neutral)
    assert all(part.size == 0.0 for part in effect.modify(plant).corrections)


def test_it_does_what_was_learnt():
    plant = plant_parameters(STATION)
    assert MODULE.$cls().modify(plant).corrections == LEARNT.modify(plant).corrections
    assert plant.corrections == ()
''')
_ROWS = Template("""# What else a pull request for `$name` has

1. `$name.py` goes to `simulator/effects/$folder/`, its test to `tests/unit/simulator/`.
2. `from wetwell.simulator.effects.$folder.$name import $cls` and `| $cls` in `AnyEffect` go to
   `simulator/effects/__init__.py`, in the order of the alphabet.
3. A row in `docs/effects.md`:

    | `$name` | $component | $summary | $row | say how it shows itself in Q, H, P and L |

4. A deviation of the same kind in each plant that stands for reality (`sim2real/truth`), with equations of its own.
5. The physics, its source, and ranges that the field has seen, in the place of what was learnt: $equation
""")


def new_effect(diagnosis: Path, name: str, out: Path) -> dict[str, object]:
    """Write source, test and rows of an effect that does what the correction of a diagnosis does.

    Parameters
    ----------
    diagnosis : Path
        Folder that `wetwell gap diagnose` wrote.
    name : str
        Of the effect: small letters, digits and underscores.
    out : Path
        Folder, made where it is missing.

    Raises
    ------
    ConfigError
        If the name is taken or no name, the station file has no correction, or a file is there already; one line.
    """
    if not re.fullmatch(NAME, name):
        raise ConfigError(f"--name: got '{name}', must be small letters, digits and underscores such as night_grease")
    if name in EFFECTS:
        raise ConfigError(f"--name: '{name}' is in the library already")
    path = diagnosis / "station.toml"
    station = load_station(path)
    try:
        learnt = next((one for one in reversed(effects_of(station)) if isinstance(one, LearntCorrection)), None)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from error
    if learnt is None:
        raise ConfigError(f"{path}: has no effect 'learnt_correction': the diagnosis has not taken one")
    files = {f"{name}.py": _SOURCE, f"test_{name}.py": _TEST, f"{name}.md": _ROWS}
    taken = next((file for file in files if (out / file).exists()), None)
    if taken is not None:
        raise ConfigError(f"--out: {out / taken} is there already, give another folder")
    plain = station.model_copy(update={"effect": ()})
    reference = learnt.reference(plant_parameters(plain))
    words = _words(learnt, name, equation(learnt, reference), sentence(learnt, reference).partition(":")[0] + ".")
    words |= {"station": station.name, "plant": plain.model_dump_json(exclude_none=True)}
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--out: {out}: cannot be made: {error.strerror}") from error
    for file, template in files.items():
        with atomic_file(out / file) as written:
            written.write(template.substitute(words).encode())
    return {"effect": name, "files": [str(out / file) for file in files], "to_do": str(out / f"{name}.md")}


def _words(learnt: LearntCorrection, name: str, formula: str, summary: str) -> dict[str, object]:
    sizes = {"offset": learnt.offset} | {f"size_{k}": part.size for k, part in enumerate(learnt.part, start=1)}
    component = learnt.place
    of_parts = []
    for k, part in enumerate(learnt.part, start=1):
        given = part.model_dump(exclude_none=True, exclude={"size"})
        of_parts.append(
            f"PartTable({', '.join(f'{key}={value!r}' for key, value in given.items())}, size=self.size_{k})"
        )
    return {
        "name": name,
        "cls": "".join(word.capitalize() for word in name.split("_")),
        "summary": summary,
        "equation": formula,
        "component": component,
        "folder": _FOLDER_OF.get(component, "telemetry"),
        "term": learnt.term,
        "pump": learnt.pump,
        "main": learnt.main,
        "learnt": learnt.model_dump_json(exclude_none=True),
        "neutral": ", ".join(f'"{key}": 0.0' for key in sizes),
        "described": "\n".join(f"    {key} : float\n        Share of the term; 0 is none. [1]" for key in sizes),
        "fields": "\n".join(
            f'    {key}: Annotated[float, limits(-0.9, 4.0, "1")] = {size!r}' for key, size in sizes.items()
        ),
        "parts": "".join(f"{one}, " for one in of_parts),
        "row": ", ".join(f"`{key}` -0.9 to 4 ({size:.3g})" for key, size in sizes.items()),
    }
