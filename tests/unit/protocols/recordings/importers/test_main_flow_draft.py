"""Drafts of an export with one flow meter in the main of several pumps."""

import numpy as np
import pytest

from wetwell.protocols.recordings.importers.conversion import convert
from wetwell.protocols.recordings.importers.draft.draft import draft_of
from wetwell.protocols.recordings.importers.mapping import load_mapping

EXPORT = """Zeit;Füllstand;Druckleitung Durchfluss;P1 Betrieb;P2 Betrieb;Überlauf Durchfluss
;cm;l/s;;;l/s
15.11.2024 12:00:00;120,5;40,1;EIN;AUS;0
15.11.2024 12:01:00;121,5;60,2;EIN;EIN;0
15.11.2024 12:02:00;122,5;0,0;AUS;AUS;0
"""


def drafted(tmp_path, text):
    export = tmp_path / "export.csv"
    export.write_text(text, encoding="utf-8")
    return export, draft_of([export])


def test_a_draft_takes_the_one_flow_without_pump_for_that_of_the_main(tmp_path):
    export, draft = drafted(tmp_path, EXPORT)
    assert draft.assumed["main1_flow_m3h"] == (
        "'Druckleitung Durchfluss' by 'durchfluss', which names no pump in l/s: 'l/s' in the file"
    )
    assert "pumps = [1, 2]  # assumed: all; CHECK, and that it is no inflow" in draft.text
    assert draft.unmapped == ["Überlauf Durchfluss"]
    text = draft.text.replace('# time_zone = "Europe/Helsinki"', 'time_zone = "UTC"')
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(text, encoding="utf-8")
    done = convert([export], load_mapping(mapping))
    np.testing.assert_allclose(done.recording.columns["pump1_flow_m3h"], [144.36, np.nan, 0.0])
    np.testing.assert_allclose(done.recording.columns["pump2_flow_m3h"], [0.0, np.nan, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Druckleitung Durchfluss", "Zulauf Durchfluss", "[signal.inflow_m3h]"),
        ("Druckleitung Durchfluss", "P1 Durchfluss", "[signal.pump1_flow_m3h]"),
        ("P2 Betrieb", "P2 Durchfluss", '# not used: "Druckleitung Durchfluss": unit l/s'),
        ("P2 Betrieb", "P2 Leistung [kW]", "names no pump; main1_flow_m3h, but nothing tells when pump 2 runs"),
        ("Überlauf", "Messstrecke", "names no pump; main1_flow_m3h, or one of 1 more?"),
    ],
)
def test_a_draft_takes_no_other_flow_for_it(tmp_path, old, new, said):
    _, draft = drafted(tmp_path, EXPORT.replace(old, new))
    assert said in draft.text
    assert "[signal.main1_flow_m3h]" not in draft.text


def test_a_draft_knows_the_letters_of_a_loop(tmp_path):
    _, draft = drafted(tmp_path, EXPORT.replace("Druckleitung Durchfluss", "FT-100"))
    assert "[signal.main1_flow_m3h]\ntag = \"FT-100\"  # assumed: by 'FT', which names no pump" in draft.text
