// The last samples as lines: level, then flow, head, frequency and power of each pump.

import { html, panel } from "./dom.js";
import { chart, pen } from "./chart.js";

const QUANTITIES = [
  { name: "flow", word: "Flow", unit: "m³/h" },
  { name: "head", word: "Head", unit: "m" },
  { name: "frequency", word: "Frequency", unit: "Hz" },
  { name: "power", word: "Power", unit: "kW" },
];
const DRAW_MS = 450;

export function livePanel(station, chosen) {
  const key = html("ul", { class: "key" });
  const limits = () => [
    ...(station.model?.start_levels_m ?? []).slice(0, 1).map((value) => ({ value, word: "first start" })),
    ...(station.model?.stop_levels_m ?? []).slice(0, 1).map((value) => ({ value, word: "first stop" })),
  ];
  const level = chart("Level over time", () => [{ label: "level", pen: "pen1", width: 2 }], { unit: "Level, m", sync: "live", limits });
  const pumps = QUANTITIES.map(({ name, word, unit }) => ({
    name,
    chart: chart(`${word} of each pump over time`, pumpLines, { unit: `${word}, ${unit}`, sync: "live", height: 110 }),
  }));
  const element = panel("Live", key, level.element, ...pumps.map((each) => each.chart.element));
  element.classList.add("is-live");
  let drawn = 0;

  function pumpLines() {
    return Array.from({ length: station.pumps }, (_, place) => ({ label: `pump ${station.called(place + 1)}`, ...pen(place + 1), width: place + 1 === chosen() ? 2.2 : 1.1 }));
  }

  function showKey() {
    const lines = pumpLines();
    if (key.textContent === lines.map((line) => line.label).join("")) return;
    key.replaceChildren(...lines.map((line, place) => html("li", {}, html("span", { class: `stroke pen${(place % 4) + 1}` }), line.label)));
  }

  function update(changed) {
    const now = performance.now();
    if (!changed.has("rows") || (now - drawn < DRAW_MS && !changed.has("begin") && !changed.has("pump"))) return;
    drawn = now;
    showKey();
    const times = station.rows.map((row) => row[0] / 1000);
    level.update([times, station.rows.map((row) => row[1])]);
    for (const { name, chart: each } of pumps) {
      each.update([times, ...Array.from({ length: station.pumps }, (_, place) => station.rows.map((row) => station.pump(place + 1, row)[name]))]);
    }
  }

  return { element, update, end: () => [level, ...pumps.map((each) => each.chart)].forEach((each) => each.end()) };
}
