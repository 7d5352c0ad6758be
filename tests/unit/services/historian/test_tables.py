"""Answers as tables: what people call a pump stands beside its number, where it is known."""

from wetwell.protocols.messages.history import Episode, History
from wetwell.services.historian.tables import history_table

LABELS = ("Pumpwerk Süd 1", "Pumpwerk Süd Nord")
SEVERITY = {"quantity": "wear_head_percent", "value": 6.1, "interval": [5.5, 6.7], "limit": 5.0}
EPISODE = Episode.model_validate(
    {"time": 0, "station": "sued", "asset": "pump:2", "state": "pump_fault", "stage": "act", "from": 0}
    | {"severity": SEVERITY}
).model_dump(by_alias=True)
VERDICT = {"time": "2026-03-02T08:00:00Z", "pump": 2, "state": "normal"}


def test_pumps_of_episodes_and_verdicts_have_their_names() -> None:
    episodes = History(kind="episodes", station="sued", messages=[EPISODE, EPISODE | {"asset": "main"}])
    assert [row["asset"] for row in history_table(episodes, LABELS)["episodes"]] == [
        "pump:2 (Pumpwerk Süd Nord)",
        "main",
    ]
    told = history_table(episodes)["episodes"][0]
    assert (told["to"], told["severity"]) == ("stands", "loss of head 6.1 % (5.5 to 6.7), limit 5 %")
    verdicts = History(kind="verdicts", station="sued", messages=[VERDICT])
    assert history_table(verdicts, LABELS)["verdicts"][0]["pump"] == "2 (Pumpwerk Süd Nord)"


def test_the_title_of_the_station_stands_beside_its_key() -> None:
    samples = History(kind="samples", station="sued", time=[0], columns={"level_m": [1.0]})
    assert history_table(samples, LABELS, "Pumpwerk Süd")["station"] == "sued (Pumpwerk Süd)"


def test_without_the_station_file_only_the_keys_are_known() -> None:
    verdicts = History(kind="verdicts", station="sued", messages=[VERDICT])
    assert history_table(verdicts)["verdicts"] == [VERDICT]
