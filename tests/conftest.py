"""What the tests share: the paper's station, a deadline-free hypothesis, and the folder of real recordings."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from wetwell.protocols.station import Sensors, Station
from wetwell.services.presets import find_station

# The first call of a kernel compiles it: a time limit for one example says nothing.
settings.register_profile("wetwell", deadline=None)
settings.load_profile("wetwell")


@pytest.fixture(scope="session")
def alpha() -> Station:
    """The paper's station, with its noise."""
    return find_station("alpha")


@pytest.fixture(scope="session")
def quiet_alpha(alpha) -> Station:
    """The paper's station with perfect sensors."""
    quiet = Sensors(flow_noise=0, head_noise=0, power_noise=0, inflow_noise=0, level_noise_m=0)
    return alpha.model_copy(update={"sensors": quiet})


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, outside of this repository."""
    name = os.environ.get("WETWELL_TEST_DATA")
    if not name:
        pytest.skip("WETWELL_TEST_DATA is not set; it names the folder that has skab/")
    folder = Path(name)
    if not (folder / "skab").is_dir():
        pytest.skip(f"WETWELL_TEST_DATA = {name} has no folder skab/")
    return folder
