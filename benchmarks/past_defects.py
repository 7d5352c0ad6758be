"""Defects that the project once had, each as the change that puts it back, with the commit that mended it."""

from typing import NamedTuple


class PastDefect(NamedTuple):
    """Replaces `now` in a file by `then`: what it did before `mended_in`, or what amounts to it."""

    name: str
    mended_in: str
    path: str
    now: str
    then: str


STORE = "services/historian/store"

PAST_DEFECTS = (
    PastDefect(
        "a second detector works on the same folder",
        "41fcdb9",
        "services/detector/daemon.py",
        'with folder_held(settings.detector.state_dir, "detector.state_dir", "detector") as hold:',
        'with folder_held(None, "detector.state_dir", "detector") as hold:',
    ),
    PastDefect(
        "second alarms work on the same folder",
        "41fcdb9",
        "services/alarms/daemon.py",
        'with folder_held(kept.state_dir, "alarms.state_dir", "alarms") as hold:',
        'with folder_held(None, "alarms.state_dir", "alarms") as hold:',
    ),
    PastDefect(
        "what a checkpoint says was told is not checked",
        "41fcdb9",
        "services/detector/checkpoint.py",
        "!= _checksum(header, rest) and not is_earlier",
        "is None and not is_earlier",
    ),
    PastDefect(
        "rows of samples are not checked when they are read",
        "41fcdb9",
        f"{STORE}/live/database.py",
        "elif is_sample_intact(station, time_ns, seq, quality, size, data, last_ns, crc):",
        "elif len(data) % (8 * size) == 0:",
    ),
    PastDefect(
        "messages are not checked when they are read",
        "41fcdb9",
        f"{STORE}/live/database.py",
        "elif is_event_intact(*row):",
        "elif isinstance(row[4], bytes):",
    ),
    PastDefect(
        "a daily file of another station or day is taken",
        "41fcdb9",
        f"{STORE}/archive.py",
        "if said not in (station, None) or not np.all((time_ns >= day_ns) & (time_ns < day_ns + DAY_NS)):",
        "if said is not None and not said:",
    ),
    PastDefect(
        "a database found damaged while it is used stays in use",
        "41fcdb9",
        f"{STORE}/live/file.py",
        "        if isinstance(error, UnicodeDecodeError):\n",
        "        return\n        if isinstance(error, UnicodeDecodeError):\n",
    ),
    PastDefect(
        "nothing is saved of a damaged database",
        "41fcdb9",
        f"{STORE}/live/file.py",
        "saved, lost = salvage(aside, self._writer)",
        "saved, lost = 0, 0",
    ),
    PastDefect(
        "nothing is looked through",
        "41fcdb9",
        "services/historian/service.py",
        "                next(self._scrubbing)",
        "                break",
    ),
    PastDefect(
        "what publishers keep is not taken again after damage",
        "41fcdb9",
        "services/historian/daemon.py",
        "        if historian.damages > damages:",
        "        if historian.damages < damages:",
    ),
    PastDefect(
        "a row that is damaged keeps the same one from coming again",
        "769a621",
        f"{STORE}/live/database.py",
        '"WHERE payload != excluded.payload OR crc != excluded.crc"',
        '"WHERE payload != payload"',
    ),
    PastDefect(
        "pages of daily files are not checked",
        "b9d9f2a",
        f"{STORE}/archive.py",
        "page_checksum_verification=True",
        "page_checksum_verification=False",
    ),
    PastDefect(
        "alarms of the site itself are refused by the historian",
        "a828930",
        "services/historian/service.py",
        "is_name = station == SITE or _NAME.match(station) is not None",
        "is_name = _NAME.match(station) is not None",
    ),
    PastDefect(
        "old verdicts from caches are news to alarms that start",
        "b35d6e8",
        "services/alarms/station_watch.py",
        "            if is_start:\n",
        "            if is_start and not self.times_ns:\n",
    ),
    PastDefect(
        "a start has room for few messages only",
        "9521a23",
        "services/detector/follower.py",
        "CAPACITY = 200_000",
        "CAPACITY = 200",
    ),
    PastDefect(
        "samples are judged before what was missed meanwhile",
        "66dd745",
        "services/detector/intake.py",
        "self._behind = {judge: follower.waiting[judge.station] for judge in judges if judge.is_restored}",
        "self._behind = dict[StationDetector, Waiting]()",
    ),
    PastDefect(
        "a detector that goes on does not tell its last verdicts",
        "66dd745",
        "services/detector/station_detector.py",
        "            self._tell_again(told.verdicts)",
        "            pass",
    ),
    PastDefect(
        "alarms that start do not tell what stands",
        "668c9c5",
        "services/alarms/daemon.py",
        "    service.publish_all()\n",
        "",
    ),
    PastDefect(
        "what the store refuses is lost",
        "2730c64",
        "services/historian/service.py",
        "                self._spool.put_back(rows)\n",
        "",
    ),
    PastDefect(
        "the historian takes nothing that was told before its start",
        "2730c64",
        "services/historian/daemon.py",
        'bus.subscribe(sample_key("*"), history=ALL_KEPT, capacity=CAPACITY, pace_s=PACE_S)',
        'bus.subscribe(sample_key("*"), capacity=CAPACITY, pace_s=PACE_S)',
    ),
)
