// All stations: what state they are in, with figures once a second.

import { query, remember } from "../base/address.js";
import { announce, html, say } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { STATES, icon, isFault, state } from "../base/states.js";
import { follow } from "../base/stream.js";
import { t } from "../base/words.js";
import { byNeed, causeWords, stageWord } from "./causes.js";
import { stationTable } from "./station_table.js";

const FILTERS = {
  "": { word: t("all"), takes: () => true },
  act: { word: t("act"), icon: "pump_fault", takes: (station) => station.cause?.stage === "act" },
  fault: { word: t("faults"), icon: "pump_fault", takes: (station) => isFault(station.state) },
  no_data: { word: t("no data"), icon: "no_data", takes: (station) => station.state === "no_data" },
  unknown: { word: t("unknown"), icon: "unknown", takes: (station) => station.state === "unknown" },
  learning: { word: t("learning"), icon: "learning", takes: (station) => station.state === "learning" },
  normal: { word: t("normal"), icon: "normal", takes: (station) => station.state === "normal" },
  alarms: { word: t("with alarms"), takes: (station) => station.alarms > 0 },
};

const RANKS = {
  state: byNeed,
  since: (a, b) => (a.cause?.since_ms ?? Infinity) - (b.cause?.since_ms ?? Infinity) || 0,
  trend: (a, b) => (b.cause?.trend?.per_day ?? -Infinity) - (a.cause?.trend?.per_day ?? -Infinity) || 0,
  cost: (a, b) => (b.cause?.waiting_cost ?? -1) - (a.cause?.waiting_cost ?? -1),
  name: () => 0,
  level: (a, b) => (b.level ?? -1) - (a.level ?? -1),
  flow: (a, b) => (b.flow ?? -1) - (a.flow ?? -1),
  power: (a, b) => (b.power ?? -1) - (a.power ?? -1),
  gap: (a, b) => (b.gap?.matters ?? -1) - (a.gap?.matters ?? -1),
  alarms: (a, b) => b.unacknowledged - a.unacknowledged || b.alarms - a.alarms,
};

export function overviewPage(main, showLink) {
  document.title = `${t("Stations")} – wetwell`;
  const stations = [];
  let filter = query("state") in FILTERS ? query("state") : "";
  let order = query("sort") in RANKS ? query("sort") : "state";
  let find = query("find");
  let shown = [];

  const counts = {};
  const buttons = Object.entries(FILTERS).map(([name, { word, icon: shape }]) => {
    counts[name] = html("span", { class: "number" }, "0");
    return html("button", { type: "button", "aria-pressed": name === filter, "data-filter": name, onclick: () => choose(name) },
      shape ? html("span", { class: `state is-${state(shape).kind}` }, icon(shape, 13)) : null, `${word} `, counts[name]);
  });
  const search = html("input", { type: "search", placeholder: t("Find a station"), "aria-label": t("Find a station"), value: find });
  search.addEventListener("input", () => {
    find = search.value;
    remember({ find });
    sort();
  });
  const table = stationTable(order, (name) => {
    order = name;
    remember({ sort: order === "state" ? "" : order });
    sort();
  });
  main.append(
    html("div", { class: "tools" }, html("h1", {}, t("Stations")),
      html("div", { class: "filters", role: "group", "aria-label": t("Filter by state") }, ...buttons), search, html("button", { type: "button", onclick: exportShown }, t("download what is drawn"))),
    table.element,
  );

  function exportShown() {
    const names = ["name", "state", "at_fault", "stage", "since", "quantity", "value", "limit", "trend_per_day", "cost_of_waiting", "mode", "level", "flow", "power", "alarms"];
    download("stations.csv", csvOf(names, shown.map((station) => ({ ...station, ...station.cause?.severity, state: station.state, at_fault: causeWords(station), stage: stageWord(station),
      since: station.cause && new Date(station.cause.since_ms).toISOString(), trend_per_day: station.cause?.trend?.per_day, cost_of_waiting: station.cause?.waiting_cost }))));
  }

  function choose(name) {
    filter = name;
    remember({ state: filter });
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.filter === filter);
    sort();
  }

  function sort() {
    const text = find.toLowerCase();
    shown = stations.filter((station) => FILTERS[filter].takes(station) && station.name.toLowerCase().includes(text));
    shown.sort((a, b) => RANKS[order](a, b) || a.name.localeCompare(b.name, undefined, { numeric: true }));
    table.show(shown, order);
    for (const [name, { takes }] of Object.entries(FILTERS)) say(counts[name], String(stations.filter(takes).length));
  }

  function apply(frame) {
    let isSortedAnew = false;
    for (const [index, summary] of Object.entries(frame.stations)) {
      const station = (stations[index] ??= { running: [] });
      if (station.state && station.state !== summary.state && isFault(summary.state)) {
        announce(`${summary.name}: ${STATES[summary.state].word}`);
      }
      Object.assign(station, summary);
      isSortedAnew = true;
    }
    for (const [index, time, level, flow, power, running] of frame.live) {
      Object.assign(stations[index], { time, level, flow, power, running });
    }
    if (isSortedAnew) sort();
    else table.update();
  }

  const end = follow("/events", "/api/stations", {
    begin(frame) {
      stations.length = 0;
      apply(frame);
    },
    apply,
    link(isThere) {
      table.link(isThere);
      showLink(isThere);
    },
  });
  return {
    end() {
      end();
      table.end();
    },
  };
}
