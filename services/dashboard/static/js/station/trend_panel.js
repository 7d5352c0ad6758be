// Stacked trends over the range of the page: bands of verdicts and alarms, then level, flow, head, frequency and power,
// under one cursor. Drag to zoom, click to look at a moment.

import { textOf } from "../alarms/alarm_words.js";
import { chart, pen } from "../base/chart.js";
import { html, panel, say } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { figure, moment, zone } from "../base/format.js";
import { grade } from "../base/quality.js";
import { absence } from "../base/absent.js";
import { STATES, faultsOf, isOfMain, kindOf, stageOf } from "../base/states.js";
import { language, t } from "../base/words.js";

const OF_PUMPS = [
  { column: "flow_m3h", name: "flow", word: t("Flow"), unit: "m³/h", digits: 0 },
  { column: "head_m", name: "head", word: t("Head"), unit: "m", digits: 1 },
  { column: "frequency_hz", name: "frequency", word: t("Frequency"), unit: "Hz", digits: 1 },
  { column: "power_kw", name: "power", word: t("Power"), unit: "kW", digits: 1 },
];
const PENS = { urgent: "urgent", warn: "warn", sensor: "sensor", doubt: "doubt", gone: "steel", calm: "soft" };
const LANE = 17;
const DRAW_MS = 450;

export function trendPanel({ station, range, past, chosen, choose }) {
  const key = html("ul", { class: "key" });
  const readout = html("p", { class: "note readout" });
  const note = html("p", { class: "note", role: "status", id: "trend-note" });
  const away = absence("historian");
  const old = absence("source");
  let at = null;
  let drawn = 0;
  let times = [];
  let values = {};

  const span = () => (range.isLive ? (times.length > 1 ? [times[0], times.at(-1)] : null) : range.limits());
  const common = { span, sync: "trends", onZoom: range.between, onPick: range.pick, onCursor, marked: () => range.at, bands: shades };
  const lanes = chart(t("Verdicts and alarms over time; the lists below tell the same"), () => [{ label: t("bands") }],
    { ...common, bands: laneBands, height: () => 46 + LANE * laneNames().length, range: () => [0, 1], splits: (self) => laneNames().map((_, place) => 1 - (place + 0.5) / laneNames().length), ticks: (_, splits) => splits.map((_split, place) => laneNames()[place] ?? "") });
  const limits = () => [
    ...(station.model?.start_levels_m ?? []).slice(0, 1).map((value) => ({ value, word: t("first start") })),
    ...(station.model?.stop_levels_m ?? []).slice(0, 1).map((value) => ({ value, word: t("first stop") })),
  ];
  const level = chart(t("Level over time"), () => linesOf("level_m", [{ label: t("level"), pen: "pen1", width: 2 }]), { ...common, unit: t("Level, {unit}", { unit: "m" }), limits, height: 120 });
  const pumps = OF_PUMPS.map((each) => ({
    ...each,
    chart: chart(t("{quantity} of each pump over time", { quantity: each.word }), () => pumpLines(each.column), { ...common, unit: `${each.word}, ${each.unit}`, height: 105 }),
  }));
  const charts = html("div", { class: "trends" }, lanes.element, level.element, ...pumps.map((each) => each.chart.element));
  const link = html("a", { download: "", class: "button" }, t("download as recording"));
  const shown = html("button", { type: "button", onclick: exportShown }, t("download what is drawn"));
  const now = html("button", { type: "button", hidden: true, onclick: () => range.pick(null) }, t("look at the end again"));
  const element = panel(t("Trends"), old.element, away.element, key, charts, readout, note);
  element.querySelector("header").append(html("div", { class: "buttons" }, now, shown, link));
  element.classList.add("is-trends");

  /** Rows of the lanes: each pump, each main, then the alarms. */
  const laneNames = () => [...station.numbers.map((number) => station.nameOf(number) ?? t("Pump {name}", { name: number })), ...station.mains.map((name) => name ?? t("Main")), t("Alarms")];

  function bandsOf() {
    if (past.bands.verdicts.length || past.bands.alarms.length || !range.isLive) return past.bands;
    return { verdicts: [], alarms: [] };
  }

  function laneBands() {
    const all = laneNames().length;
    const found = [];
    for (const band of bandsOf().verdicts) {
      const faults = faultsOf(band);
      const own = faults.find((fault) => !isOfMain(fault));
      const ofMain = faults.find(isOfMain);
      if (band.pump <= station.pumps) found.push({ ...band, lane: band.pump - 1, lanes: all, pen: own ? PENS[kindOf(own)] : ofMain ? "line" : PENS[kindOf({ state: band.state })] });
      if (ofMain) found.push({ ...band, lane: station.pumps + station.mainOf(band.pump), lanes: all, pen: PENS[kindOf(ofMain)] });
    }
    for (const band of bandsOf().alarms) found.push({ ...band, lane: all - 1, lanes: all, pen: { low: "doubt", advisory: "steel", medium: "warn" }[band.priority] ?? "urgent" });
    return found;
  }

  /** Faults of the chosen pump and of its main, behind each chart. */
  function shades() {
    const isMine = (band, fault) => (isOfMain(fault) ? station.mainOf(band.pump) === station.mainOf(chosen()) : band.pump === chosen());
    return bandsOf().verdicts.flatMap((band) => {
      const fault = faultsOf(band).find((each) => isMine(band, each));
      return fault ? [{ ...band, pen: { urgent: "urgent-ground", warn: "warn-ground" }[kindOf(fault)] ?? "soft" }] : [];
    });
  }

  function linesOf(column, lines) {
    if (!values[`${column}_min`] || lines.length > 1) return lines;
    return [...lines, { label: t("greatest"), pen: lines[0].pen, width: 0.4 }, { label: t("least"), pen: lines[0].pen, width: 0.4, band: -1 }];
  }

  function pumpLines(column) {
    const lines = station.numbers.map((number) => ({ label: t("pump {name}", { name: station.called(number) }), ...pen(number), width: number === chosen() ? 2.2 : 1.1 }));
    if (!values[`pump${chosen()}_${column}_min`]) return lines;
    const edge = { pen: pen(chosen()).pen, width: 0.4 };
    return [...lines, { label: t("greatest"), ...edge }, { label: t("least"), ...edge, band: -1 }];
  }

  function showKey() {
    const lines = pumpLines("none");
    const form = lines.map((line) => line.label).join("|");
    if (key.dataset.form === form) return;
    key.dataset.form = form;
    key.replaceChildren(...lines.map((line, place) => html("li", {}, html("span", { class: `stroke pen${(place % 4) + 1}` }), line.label)));
  }

  function gather() {
    if (range.isLive) {
      times = station.rows.map((row) => row[0]);
      values = { level_m: station.rows.map((row) => row[1]), inflow_m3h: station.rows.map((row) => row[2]) };
      for (const number of station.numbers) {
        for (const { column, name } of OF_PUMPS) values[`pump${number}_${column}`] = station.rows.map((row) => station.pump(number, row)[name]);
      }
    } else {
      times = past.trends?.times ?? [];
      values = past.trends?.columns ?? {};
    }
  }

  function draw() {
    gather();
    showKey();
    const seconds = times.map((time) => time / 1000);
    const of = (name) => values[name] ?? times.map(() => null);
    const edges = (name) => (values[`${name}_min`] ? [of(`${name}_max`), of(`${name}_min`)] : []);
    const isEmpty = times.length === 0;
    charts.hidden = isEmpty && !range.isLive;
    lanes.update([seconds, times.map(() => null)]);
    level.update([seconds, of("level_m"), ...edges("level_m")]);
    for (const { column, chart: each } of pumps) each.update([seconds, ...station.numbers.map((number) => of(`pump${number}_${column}`)), ...edges(`pump${chosen()}_${column}`)]);
    grade(charts, range.isLive ? station.currency.kind : "good");
    tellAt(at ?? range.at);
  }

  function onCursor(ms) {
    at = ms;
    tellAt(ms ?? range.at);
  }

  /** What is there at a moment: values, verdict and alarms. */
  function tellAt(ms) {
    if (ms == null || !times.length) {
      say(readout, t("Move over a chart to read it; click to look at that moment; drag to zoom."));
      return;
    }
    let place = times.findIndex((time) => time >= ms);
    if (place < 0) place = times.length - 1;
    const number = chosen();
    const parts = [t("level {value} m", { value: figure(values.level_m?.[place], 2) })];
    for (const { column, word, unit, digits } of OF_PUMPS) parts.push(`${language === "en" ? word.toLowerCase() : word} ${figure(values[`pump${number}_${column}`]?.[place], digits)} ${unit}`);
    const during = (band) => band.from <= ms && (band.to ?? Infinity) > ms;
    const band = bandsOf().verdicts.filter((each) => each.pump === number).findLast(during);
    if (band) parts.push(STATES[band.state]?.word ?? band.state, stageOf(band)?.word);
    for (const alarm of bandsOf().alarms.filter(during)) parts.push(textOf(alarm));
    say(readout, `${moment(times[place])}, ${t("pump {name}", { name: station.called(number) })}: ${parts.filter(Boolean).join(", ")}`);
  }

  function exportShown() {
    const names = ["time", ...Object.keys(values)];
    const rows = times.map((time, place) => ({ time: new Date(time).toISOString(), ...Object.fromEntries(Object.entries(values).map(([name, column]) => [name, column[place]])) }));
    download(`${station.name}-trends.csv`, csvOf(names, rows));
  }

  function update(changed) {
    away.show(station.has("historian"));
    old.show(!range.isLive || station.has("source") || station.currency.kind === "never");
    now.hidden = range.at == null;
    const [from, to] = range.isLive && times.length ? [times[0], times.at(-1)] : range.limits();
    const text = new URLSearchParams({ start: new Date(from).toISOString(), end: new Date(to + 1).toISOString() });
    link.href = `/api/stations/${encodeURIComponent(station.name)}/recording.csv?${text}`;
    const isDue = ["begin", "pump", "past", "range", "bands", "model"].some((name) => changed.has(name));
    const time = performance.now();
    if (!isDue && !changed.has("tick") && !(range.isLive && changed.has("rows") && time - drawn > DRAW_MS)) return;
    drawn = time;
    if (range.isLive) say(note, "");
    else if (past.error) say(note, t("No history: {reason}", { reason: past.error }));
    else if (past.trends) say(note, times.length || past.trends.times.length ? t("{from} to {to} {zone}, {points} points.", { from: moment(from), to: moment(to), zone: zone(to), points: past.trends.times.length }) : t("Nothing was kept of that time."));
    else say(note, t("Asking the historian."));
    if (changed.has("tick") && !isDue && !range.isLive) return;
    draw();
  }

  return {
    element,
    update,
    end() {
      for (const each of [lanes, level, ...pumps.map((one) => one.chart)]) each.end();
    },
  };
}
