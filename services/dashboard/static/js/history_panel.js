// The past of a station: drag to zoom, step back, download what is in sight.

import { query, remember } from "./address.js";
import { chart, pen } from "./chart.js";
import { html, mark, panel, say } from "./dom.js";
import { moment, words } from "./format.js";
import { pastOf } from "./past.js";

const SPANS = { "1h": 1, "6h": 6, "24h": 24, "7d": 168, "30d": 720 };
const DEFAULT = "24h";
const HOUR_MS = 3_600_000;
const POINTS = 700;
const STEPS = 50;
const LEAST_MS = 10_000;
const QUANTITIES = { level_m: "Level, m", flow_m3h: "Flow, m³/h", head_m: "Head, m", frequency_hz: "Frequency, Hz", power_kw: "Power, kW", inflow_m3h: "Inflow, m³/h" };
const OF_STATION = ["level_m", "inflow_m3h"];

export function historyPanel(station) {
  let quantity = query("show") in QUANTITIES ? query("show") : "level_m";
  let span = parseSpan();
  let past = null;
  let asked = "";
  let loaded = { at: 0, end: 0 };

  const choice = html("select", { "aria-label": "Quantity" }, ...Object.entries(QUANTITIES).map(([value, word]) => html("option", { value, selected: value === quantity }, word)));
  choice.addEventListener("change", () => {
    quantity = choice.value;
    remember({ show: quantity === "level_m" ? "" : quantity });
    draw();
  });
  const buttons = Object.entries(SPANS).map(([name, hours]) => html("button", { type: "button", "data-span": name, onclick: () => look({ name, hours }) }, name));
  const back = html("button", { type: "button", "aria-label": "Earlier", onclick: () => move(-0.5) }, "‹");
  const on = html("button", { type: "button", "aria-label": "Later", onclick: () => move(0.5) }, "›");
  const download = html("a", { download: "", class: "button" }, "download as recording");
  const note = html("p", { class: "note", role: "status" }, "Choose a span; drag over the chart to zoom.");
  const plot = chart("History", lines, { unit: "", height: 220, legend: "live", onZoom: (from, to) => look({ from, to }) });
  const element = panel("History", html("div", { class: "buttons" }, choice, ...buttons, back, on, download), plot.element, note);
  element.classList.add("is-history");
  plot.element.hidden = true;
  const sight = new IntersectionObserver((entries) => {
    if (span || !station.time || !entries.some((entry) => entry.isIntersecting)) return;
    span = { name: DEFAULT, hours: SPANS[DEFAULT] };
    load();
  });
  sight.observe(element);

  function parseSpan() {
    const [from, to] = [Date.parse(query("from")), Date.parse(query("to"))];
    if (from < to) return { from, to };
    const name = query("span");
    return name in SPANS ? { name, hours: SPANS[name] } : null;
  }

  function limits() {
    if (!span) return null;
    if (span.from) return [span.from, span.to];
    const end = station.time ?? Date.now();
    return [end - span.hours * HOUR_MS, end + 1000];
  }

  function look(wanted) {
    span = wanted;
    remember(span.from
      ? { span: "", from: new Date(span.from).toISOString(), to: new Date(span.to).toISOString() }
      : { span: span.name, from: "", to: "" });
    load();
  }

  function move(share) {
    const now = limits();
    if (!now) return;
    const by = share * (now[1] - now[0]);
    look({ from: Math.round(now[0] + by), to: Math.round(now[1] + by) });
  }

  async function load() {
    const [from, to] = limits();
    asked = `${from} ${to}`;
    loaded = { at: performance.now(), end: to };
    const mine = asked;
    for (const button of buttons) mark(button, "aria-pressed", button.dataset.span === span.name);
    const text = new URLSearchParams({ start: new Date(from).toISOString(), end: new Date(to).toISOString() });
    download.href = `/api/stations/${encodeURIComponent(station.name)}/recording.csv?${text}`;
    try {
      const answer = await pastOf(station.name, "samples", from, to, POINTS);
      if (mine !== asked) return;
      past = answer;
      say(note, past.times.length ? `${moment(from)} to ${moment(to)} UTC, ${past.times.length} points. Drag to zoom.` : "Nothing was kept of that time.");
      draw();
    } catch (error) {
      say(note, `No history: ${error.message}`);
    }
  }

  function names() {
    if (OF_STATION.includes(quantity)) return [{ column: quantity, label: words(quantity.replace(/_[a-z0-9]+$/, "")), number: 1 }];
    return Array.from({ length: station.pumps }, (_, place) => ({ column: `pump${place + 1}_${quantity}`, label: `pump ${station.called(place + 1)}`, number: place + 1 }));
  }

  function lines() {
    return names().flatMap(({ column, label, number }) => {
      const mean = { label, ...pen(number), width: 1.6 };
      if (!past?.columns[`${column}_min`]) return [mean];
      return [mean, { label: `${label}, greatest`, pen: pen(number).pen, width: 0.4 }, { label: `${label}, least`, pen: pen(number).pen, width: 0.4, band: -1 }];
    });
  }

  function draw() {
    if (!past) return;
    plot.element.hidden = past.times.length === 0;
    const of = (name) => past.columns[name] ?? past.times.map(() => null);
    const values = names().flatMap(({ column }) => (past.columns[`${column}_min`] ? [of(column), of(`${column}_max`), of(`${column}_min`)] : [of(column)]));
    plot.update([past.times.map((time) => time / 1000), ...values]);
  }

  /** Whether a span that ends with the last sample has moved on by a part of itself. */
  function isOld() {
    if (!span?.hours || element.querySelector(".u-select")?.offsetWidth) return false;
    return Math.abs(limits()[1] - loaded.end) > (span.hours * HOUR_MS) / STEPS && performance.now() - loaded.at > LEAST_MS;
  }

  return {
    element,
    update(changed) {
      if (span && (changed.has("begin") || isOld())) load();
    },
    end() {
      sight.disconnect();
      plot.end();
    },
  };
}
