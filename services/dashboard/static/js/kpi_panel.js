// Starts, run hours and energy by day, from the historian.

import { chart } from "./chart.js";
import { html, panel, say } from "./dom.js";
import { figure } from "./format.js";
import { pastOf } from "./past.js";

const DAYS = 14;
const DAY_MS = 86_400_000;
const AGAIN_MS = 20_000;

export function kpiPanel(station) {
  const note = html("p", { class: "empty" }, "Waiting for the historian.");
  const body = html("tbody");
  const head = html("tr", {}, ...["", "Starts", "Run hours", "Volume, m³", "Energy, kWh", "kWh/m³"].map((word, place) => html("th", { scope: "col", class: place ? "number" : "" }, word)));
  const table = html("table", { hidden: true }, html("caption", { class: "unseen" }, "Starts, run hours, volume and energy of each pump"), html("thead", {}, head), body);
  const daily = chart("Energy of each day", () => [{ label: "kWh a day", pen: "steel", fill: "soft", paths: uPlot.paths.bars({ size: [0.7, 60] }) }],
    { unit: "kWh a day", height: 110, ofDays: true, range: (_, low, high) => [0, (high || 1) * 1.1] });
  const total = chart("Cumulative energy", () => [{ label: "kWh", pen: "pen1", width: 2 }], { unit: "kWh, summed", height: 110 });
  const charts = html("div", { hidden: true, class: "pair" }, daily.element, total.element);
  const element = panel("Starts and energy", note, html("div", { class: "scroll" }, table), charts);
  element.classList.add("is-kpi");
  let asked = -AGAIN_MS;

  async function load(now) {
    try {
      const past = await pastOf(station.name, "kpi", now - DAYS * DAY_MS, now + DAY_MS, 24 * DAYS + 48);
      if (past.times.length) show(past);
      else say(note, "The historian has nothing yet.");
    } catch (error) {
      say(note, `No figures: ${error.message}`);
    }
  }

  function show({ times, columns }) {
    note.textContent = `Since ${new Date(times[0]).toISOString().slice(0, 16).replace("T", " ")}, by the historian.`;
    table.hidden = charts.hidden = false;
    const sum = (name) => (columns[name] ?? []).reduce((all, value) => all + (value ?? 0), 0);
    const line = (word, prefix) => {
      const [volume, energy] = [sum(`${prefix}volume_m3`), sum(`${prefix}energy_kwh`)];
      const values = [figure(sum(`${prefix}starts`), 0), figure(sum(`${prefix}run_h`), 1), figure(volume, 0), figure(energy, 1), volume > 0 ? figure(energy / volume, 4) : "–"];
      return html("tr", {}, html("th", { scope: "row" }, word), ...values.map((value) => html("td", { class: "number" }, value)));
    };
    body.replaceChildren(...Array.from({ length: station.pumps }, (_, place) => line(`Pump ${station.called(place + 1)}`, `pump${place + 1}_`)), line("Station", ""));
    const days = new Map();
    times.forEach((time, place) => {
      const day = Math.floor(time / DAY_MS) * DAY_MS;
      days.set(day, (days.get(day) ?? 0) + (columns.energy_kwh?.[place] ?? 0));
    });
    const noons = [...days.keys()].map((day) => (day + DAY_MS / 2) / 1000);
    const room = DAY_MS / 1000; // a day without a bar on both sides, so that none is cut
    daily.update([[noons[0] - room, ...noons, noons.at(-1) + room], [null, ...days.values(), null]]);
    let summed = 0;
    total.update([times.map((time) => time / 1000), times.map((_, place) => (summed += columns.energy_kwh?.[place] ?? 0))]);
  }

  return {
    element,
    update() {
      const now = performance.now();
      if (now - asked < AGAIN_MS || !station.time) return;
      asked = now;
      load(station.time);
    },
    end() {
      daily.end();
      total.end();
    },
  };
}
