// What the historian tells of the range that is shown: samples, and the bands of verdicts and alarms.

import { bandsOf, pastOf, trendsOf } from "../base/past.js";
import { millis } from "../base/format.js";

const POINTS = 700;
const VERDICTS = 20;
const RUNS_MS = 3 * 3_600_000;
const RUN_POINTS = 720;
const STEPS = 50;
const AGAIN_MS = 10_000;

const inMillis = (bands) => bands.map((band) => ({ ...band, from: millis(band.from), to: band.to ? millis(band.to) : null }));

/** `told(names)` says what is new: "past", "bands" or "then". */
export function pastStore(station, range, told) {
  const store = { trends: null, bands: { verdicts: [], alarms: [] }, error: "", then: [], runs: null, moment: null, load, update };
  let loaded = { at: -Infinity, end: 0, key: "" };
  let thenKey = "";

  async function load() {
    const [from, to] = range.limits();
    const key = `${range.isLive} ${from} ${to}`;
    loaded = { at: performance.now(), end: to, key };
    const isMine = () => loaded.key === key;
    const samples = range.isLive ? Promise.resolve(null) : trendsOf(station.name, from, to + 1, POINTS);
    const [trends, bands] = await Promise.allSettled([samples, bandsOf(station.name, from, to + 1)]);
    if (!isMine()) return;
    store.error = trends.reason?.message ?? bands.reason?.message ?? "";
    store.trends = trends.value ?? null;
    if (bands.value) store.bands = { verdicts: inMillis(bands.value.verdicts), alarms: withStanding(inMillis(bands.value.alarms)) };
    told(new Set(["past", "bands"]));
    loadThen(); // behind what most look at
  }

  /** An alarm that has stood since before the range has not changed in it: the page knows it from the alarms of now. */
  function withStanding(bands) {
    const standing = [...station.alarms.values()].filter((alarm) => alarm.is_active && alarm.raised && !bands.some((band) => band.id === alarm.id && band.to === null));
    return [...standing.map((alarm) => ({ ...alarm, from: millis(alarm.raised), to: null })), ...bands];
  }

  /** The moment that is looked at; of a range that moves on, its end as it was asked for. */
  const looked = () => range.at ?? (range.isOpen && Number.isFinite(loaded.at) ? loaded.end : range.moment);

  /** The verdicts up to the moment that is looked at, with their evidence, and the runs of the hours before it. */
  async function loadThen() {
    const isNow = range.isLive && range.at == null;
    const moment = looked();
    const key = isNow ? "" : `${moment}`;
    if (key === thenKey) return;
    thenKey = key;
    if (isNow) Object.assign(store, { then: [], runs: null, moment: null });
    else {
      const [found, runs] = await Promise.allSettled([
        pastOf(station.name, "verdicts", moment - 90 * 86_400_000, moment + 1, VERDICTS * Math.max(1, station.pumps)),
        trendsOf(station.name, moment - RUNS_MS, moment + 1, RUN_POINTS),
      ]);
      if (key !== thenKey) return;
      Object.assign(store, { then: found.value?.messages ?? [], runs: runs.value ?? { times: [], columns: {} }, moment });
    }
    told(new Set(["then"]));
  }

  /** Asks anew when a range that ends with the last sample has moved on by a part of itself. */
  function update() {
    if (!Number.isFinite(loaded.at)) return; // before the page knows where the time of the station ends
    if (store.trends || range.isLive) loadThen();
    if (!range.isOpen || performance.now() - loaded.at < AGAIN_MS) return;
    const [from, to] = range.limits();
    if (Math.abs(to - loaded.end) > (to - from) / STEPS) load();
  }

  return store;
}
