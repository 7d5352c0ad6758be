"""What is told of a watch: nothing before the first look, then each name in a line with fault and end."""

from wetwell.protocols.messages.gap_watch import GapWatch
from wetwell.services.stations import find_station
from wetwell.services.watch.words import message_of, watch_lines
from wetwell.sim2real.diagnosis.report import FittedParameter, FoundEffect
from wetwell.sim2real.watch.state import Called, Ended, KeptLook, WatchState

ALPHA = find_station("alpha")
FRICTION = FoundEffect(
    name="friction_bias",
    component="rising_main",
    equivalent=(),
    parameters={"factor": FittedParameter(value=1.1, ci=(1.09, 1.11), unit="1")},
)
LOOK = KeptLook(
    start_ns=0, end_ns=86_400 * 10**9, gap={"flow": 4.2}, group="flow/1/steady", matters=3.3, interval=(3.1, 3.5)
)
FRICTION_LINE = "rising main: friction bias, factor 1.1 (1.09 to 1.11), since 1970-01-01T01:00"


def called(effect=FRICTION, **fields):
    base = {"component": "rising_main", "probability": 0.98, "since_ns": 3600 * 10**9, "named_ns": 0, "span_s": 9.0}
    return Called(effect=effect, own=effect, table=None, before={}, **base | fields)


def test_before_the_first_look_nothing_is_told():
    assert message_of(WatchState(station=ALPHA)) is None


def test_each_name_is_a_line():
    state = WatchState(
        station=ALPHA,
        looks=(LOOK,),
        is_doubled=True,
        called=(called(), called(None, since_ns=None), called(fault="main")),
        past=(Ended(called=called(), ended_ns=7200 * 10**9),),
    )
    message = message_of(state)
    assert GapWatch.decode(message.encode()) == message
    assert [one.text for one in message.called] == [
        FRICTION_LINE,
        "rising main: something that no effect explains, from the first look on",
        f"{FRICTION_LINE}; the detector tells it as a fault of main",
    ]
    either = FRICTION.model_copy(update={"equivalent": ("pump_wear", "motor_slip")})
    (told,) = message_of(state.model_copy(update={"called": (called(either),)})).called
    assert ", or as well pump wear or motor slip, since" in told.text
    assert message.past[0].text.endswith("over since 1970-01-01T02:00")
    lines = watch_lines([message], {"alpha": "alpha (Pumpwerk Süd)"})
    assert lines.count("alpha (Pumpwerk Süd)") == 5, "in the table, and beside each name"
    for part in ("3.3", "friction bias", "no effect explains"):
        assert part in lines
