// Starts, run hours and energy by day, from the historian.

import { absence } from "../base/absent.js";
import { chart } from "../base/chart.js";
import { html, panel, say } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { figure, moment } from "../base/format.js";
import { pastOf } from "../base/past.js";
import { t } from "../base/words.js";

const DAYS = 14;
const DAY_MS = 86_400_000;
const AGAIN_MS = 20_000;
const MOST_DAYS = 16; // beyond, the historian tells days instead of hours

export function kpiPanel({ station, range }) {
  const note = html("p", { class: "empty" }, t("Waiting for the historian."));
  const body = html("tbody");
  const head = html("tr", {}, ...["", t("Starts"), t("Run hours"), t("Volume, m³"), t("Energy, kWh"), "kWh/m³"].map((word, place) => html("th", { scope: "col", class: place ? "number" : "" }, word)));
  const table = html("table", { hidden: true }, html("caption", { class: "unseen" }, t("Starts, run hours, volume and energy of each pump")), html("thead", {}, head), body);
  const daily = chart(t("Energy of each day"), () => [{ label: t("kWh a day"), pen: "steel", fill: "soft", paths: uPlot.paths.bars({ size: [0.7, 60] }) }],
    { unit: t("kWh a day"), height: 110, ofDays: true, range: (_, low, high) => [0, (high || 1) * 1.1] });
  const total = chart(t("Cumulative energy"), () => [{ label: "kWh", pen: "pen1", width: 2 }], { unit: t("kWh, summed"), height: 110 });
  const away = absence("historian");
  const charts = html("div", { hidden: true, class: "pair" }, daily.element, total.element);
  const element = panel(t("Starts and energy"), away.element, note, html("div", { class: "scroll" }, table), charts);
  element.classList.add("is-kpi");
  let asked = -AGAIN_MS;
  let key = "";
  let rows = [];
  let names = [];
  element.querySelector("header").append(html("button", { type: "button", onclick: () => download(`${station.name}-energy.csv`, csvOf(names, rows)) }, t("download what is drawn")));

  async function load() {
    const [from, to] = range.isLive ? [range.moment - DAYS * DAY_MS, range.moment + DAY_MS] : range.limits();
    const mine = (key = `${range.isLive} ${from} ${to}`);
    try {
      const past = await pastOf(station.name, "kpi", from, to, 24 * MOST_DAYS);
      if (mine !== key) return;
      table.hidden = charts.hidden = past.times.length === 0;
      if (past.times.length) show(past);
      else say(note, t("Nothing was kept of that time."));
    } catch (error) {
      if (mine !== key) return;
      table.hidden = charts.hidden = true;
      say(note, t("No figures: {reason}", { reason: error.message }));
    }
  }

  function show({ times, columns }) {
    say(note, t("{from} to {to}, by the historian.", { from: moment(times[0]), to: moment(times.at(-1)) }));
    names = ["time", ...Object.keys(columns)];
    rows = times.map((time, place) => ({ time: new Date(time).toISOString(), ...Object.fromEntries(Object.entries(columns).map(([name, column]) => [name, column[place]])) }));
    const sum = (name) => (columns[name] ?? []).reduce((all, value) => all + (value ?? 0), 0);
    const line = (word, prefix) => {
      const [volume, energy] = [sum(`${prefix}volume_m3`), sum(`${prefix}energy_kwh`)];
      const values = [figure(sum(`${prefix}starts`), 0), figure(sum(`${prefix}run_h`), 1), figure(volume, 0), figure(energy, 1), volume > 0 ? figure(energy / volume, 4) : "–"];
      return html("tr", {}, html("th", { scope: "row" }, word), ...values.map((value) => html("td", { class: "number" }, value)));
    };
    body.replaceChildren(...Array.from({ length: station.pumps }, (_, place) => line(t("Pump {name}", { name: station.called(place + 1) }), `pump${place + 1}_`)), line(t("Station"), ""));
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
    update(changed) {
      away.show(station.has("historian"));
      const now = performance.now();
      const isDue = changed.has("range") || changed.has("begin") || (range.isOpen && now - asked > AGAIN_MS);
      if (!isDue || !(station.time ?? station.kept)) return;
      asked = now;
      load();
    },
    end() {
      daily.end();
      total.end();
    },
  };
}
