"""SKAB has flow only: the detector must say so, and blame nobody."""

import pytest

from wetwell.detector.nominal import nominal_of
from wetwell.detector.pipeline import Detector
from wetwell.protocols.importers.skab import read_skab
from wetwell.protocols.station import Station

RIG = Station.model_validate(
    {
        "name": "skab",
        "sump": {"area_m2": 1.0},
        "pump": [{"points": [(0.0, 20.0), (2.0, 15.0), (4.0, 1.0)]}],
        "rising_main": {"static_head_m": 0.5, "friction_h2_m5": 1.0},
    }
)


@pytest.mark.real_data
@pytest.mark.parametrize("folder", ["anomaly-free", "valve1", "valve2"])
def test_a_rig_with_flow_only_is_never_blamed(real_data, folder):
    paths = sorted((real_data / "skab").rglob(f"{folder}/*.csv.gz"))
    assert paths, f"no {folder}/*.csv.gz under {real_data / 'skab'}"
    for path in paths:
        detector = Detector(RIG.name, nominal_of(RIG))
        verdicts = [verdict for sample in read_skab(path).samples(RIG.name) for verdict in detector.update(sample)]
        verdicts += detector.finish()
        assert {verdict.state for verdict in verdicts} == {"learning", "unknown"}, path
        for verdict in verdicts[1:]:
            assert verdict.state == "unknown", path
            assert {"frequency_hz", "head_m"} <= set(verdict.evidence["missing"]), path
            assert verdict.evidence["reason"].startswith("without frequency_hz, head_m pump and system"), path
