// Thousands of stations in a table of which only the lines in sight exist.

import { html, mark, say } from "./dom.js";
import { clock, figure } from "./format.js";
import { pumpIcons } from "./pump_icons.js";
import { icon, state } from "./states.js";

const SPARE = 4;
const COLUMNS = [
  ["state", "State", ""],
  ["name", "Station", ""],
  [null, "Pumps", "middle"],
  ["level", "Level", ""],
  ["flow", "Flow, m³/h", "number wide"],
  ["power", "Power, kW", "number wide"],
  ["alarms", "Alarms", "number middle"],
  [null, "Last sample", "wide"],
];

export function stationTable(order, choose) {
  const heads = COLUMNS.map(([name, word, kind]) => {
    const content = name ? html("button", { type: "button", "data-sort": name, onclick: () => choose(name) }, word) : word;
    return html("div", { role: "columnheader", class: kind, "data-sort": name ?? "" }, content);
  });
  const sheet = html("div", { class: "sheet", role: "presentation" });
  const window_ = html("div", { class: "window body", role: "rowgroup", tabindex: 0, "aria-label": "Stations" }, sheet);
  const element = html("div", { class: "stations", role: "table", "aria-label": "Stations" },
    html("div", { role: "rowgroup" }, html("div", { class: "line head", role: "row", "aria-rowindex": 1 }, ...heads)), window_);
  const empty = html("p", { class: "empty" }, "No station.");
  const lines = [];
  let stations = [];

  function update() {
    const height = lineHeight();
    const first = Math.max(0, Math.floor(window_.scrollTop / height) - SPARE);
    const last = Math.min(stations.length, Math.ceil((window_.scrollTop + window_.clientHeight) / height) + SPARE);
    const wanted = Math.max(0, last - first);
    while (lines.length < wanted) {
      lines.push(stationLine());
      sheet.append(lines.at(-1).element);
    }
    while (lines.length > wanted) lines.pop().element.remove();
    lines.forEach((line, place) => line.show(stations[first + place], first + place, height));
  }

  function lineHeight() {
    return 2.5 * parseFloat(getComputedStyle(document.documentElement).fontSize);
  }

  function show(wanted, sorted) {
    stations = wanted;
    mark(element, "aria-rowcount", stations.length + 1);
    sheet.style.height = `${stations.length * lineHeight()}px`;
    for (const head of heads) {
      if (head.dataset.sort === sorted) head.setAttribute("aria-sort", sorted === "name" ? "ascending" : "descending");
      else head.removeAttribute("aria-sort");
    }
    if (stations.length) empty.remove();
    else window_.append(empty);
    update();
  }

  let isDue = false;
  window_.addEventListener("scroll", () => {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      update();
    });
  });
  const size = new ResizeObserver(update);
  size.observe(window_);
  return { element, show, update, end: () => size.disconnect() };
}

function stationLine() {
  const word = html("span");
  const chip = html("span", { class: "state" }, word);
  const name = html("a", { href: "/" });
  const pumps = pumpIcons();
  const fill = html("span", { class: "fill" });
  const level = html("span", { class: "value" });
  const cells = { flow: html("span"), power: html("span"), alarms: html("span"), time: html("span") };
  const cell = (kind, ...children) => html("div", { role: "cell", class: `cell ${kind}` }, ...children);
  const element = html("div", { class: "line", role: "row" },
    cell("", chip), cell("", name), cell("middle", pumps.element),
    cell("gauge", html("span", { class: "track", "aria-hidden": "true" }, fill), level),
    cell("number wide", cells.flow), cell("number wide", cells.power), cell("number middle", cells.alarms), cell("wide", cells.time));
  let shown = "";

  function show(station, place, height) {
    element.style.transform = `translateY(${place * height}px)`;
    mark(element, "aria-rowindex", place + 2);
    if (shown !== station.state) {
      shown = station.state;
      chip.className = `state is-${state(shown).kind}`;
      chip.dataset.state = shown;
      chip.replaceChildren(icon(shown), word);
      say(word, state(shown).word);
    }
    if (name.textContent !== station.name) {
      name.textContent = station.name;
      name.href = `/station/${encodeURIComponent(station.name)}`;
    }
    pumps.show(station.pumps, station.running, station.names);
    const { floor } = station;
    const depth = ((station.levels[0] ?? floor + 2) - floor) * 1.2;
    fill.style.transform = `scaleX(${Math.min(1, Math.max(0, ((station.level ?? floor) - floor) / depth))})`;
    say(level, `${figure(station.level, 2)} m`);
    say(cells.flow, figure(station.flow, 0));
    say(cells.power, figure(station.power, 1));
    say(cells.alarms, station.alarms ? `${station.alarms}${station.unacknowledged ? ` (${station.unacknowledged} new)` : ""}` : "");
    cells.alarms.className = station.unacknowledged ? "is-urgent" : "";
    say(cells.time, clock(station.time));
  }
  return { element, show };
}
