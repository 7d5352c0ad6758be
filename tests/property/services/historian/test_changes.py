"""Changes of state are kept as they come: what is told of a span is what its verdicts say."""

import contextlib
import tempfile
from pathlib import Path

from hypothesis import example, given, settings
from hypothesis import strategies as st

from wetwell.protocols.messages.history import History, HistoryQuery
from wetwell.protocols.messages.verdict import Verdict
from wetwell.services.historian.changes import changed
from wetwell.services.historian.service import Historian
from wetwell.services.historian.store.folder_store import FolderStore
from wetwell.services.historian.store.interface import Batch, EventRow

TOLD = st.tuples(
    st.integers(1, 2), st.sampled_from(["normal", "pump_fault"]), st.sampled_from([None, "watch", "act"])
)


def verdict(time: int, pump: int, state: str, stage: str | None) -> bytes:
    fields = {"time": time, "station": "a", "pump": pump, "state": state, "stage": stage, "window": (0, time)}
    fields |= {"asset": stage and f"pump:{pump}", "probability": {}, "evidence": {"long": "x" * 99}}
    return Verdict.model_validate(fields).encode()


@settings(max_examples=40)
@given(
    told=st.lists(TOLD, min_size=1, max_size=60),
    older=st.integers(0, 60),
    again=st.integers(0, 60),
    span=st.tuples(st.integers(0, 60), st.integers(1, 60)),
)
@example(told=[(1, "normal", None)] * 2 + [(2, "normal", None)], older=2, again=0, span=(3, 1))
def test_changes_of_a_span_are_those_of_its_verdicts(told, older, again, span) -> None:
    payloads = [verdict(10 * place, *one) for place, one in enumerate(told)]
    start, end = 10 * span[0], 10 * (span[0] + span[1])
    with tempfile.TemporaryDirectory() as name, contextlib.closing(FolderStore(Path(name))) as store:
        rows = [EventRow("verdicts", "a", 10 * place, payload) for place, payload in enumerate(payloads[:older])]
        store.write(Batch(events=rows))  # as an earlier version kept them
        for part in (payloads[older:again], payloads[max(older, again - 20) :]):  # a restart, and what comes again
            historian = Historian(store)
            for payload in part:
                historian.handle("verdicts", payload)
            historian.commit(0)
        query = HistoryQuery(kind="changes", start=start, end=end, points=1000)
        answer = History.decode(historian.answer("a", query.encode()))
        assert not answer.error
        times = [10 * place for place in range(len(told))]
        before = [payload for time, payload in zip(times, payloads, strict=True) if time < start]
        within = [payload for time, payload in zip(times, payloads, strict=True) if start <= time < end]
        standing = {one.pump: one for one in changed(before)}
        found = changed(within, {pump: one.form for pump, one in standing.items()})
        said = [
            (message["pump"], message["state"], message["asset"], message["stage"]) for message in answer.messages
        ]
        assert sorted(said[: len(standing)]) == sorted((one.pump, *one.form) for one in standing.values())
        assert said[len(standing) :] == [(one.pump, *one.form) for one in found]
