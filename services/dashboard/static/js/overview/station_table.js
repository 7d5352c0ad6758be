// Thousands of stations in a table of which only the lines in sight exist.

import { html, mark, say } from "../base/dom.js";
import { clock, figure } from "../base/format.js";
import { grade } from "../base/quality.js";
import { icon, state } from "../base/states.js";
import { t } from "../base/words.js";
import { causeWords, costWords, kindOfStation, severityShort, sinceWords, stageWord, trendWords } from "./causes.js";
import { pumpIcons } from "./pump_icons.js";

const SPARE = 4;
const PHONE = matchMedia("(max-width: 700px)");
const COLUMNS = [
  ["state", t("State"), ""],
  ["name", t("Station"), ""],
  [null, t("At fault"), "cause"],
  [null, t("Stage"), "cause"],
  ["since", t("Since"), "cause"],
  [null, t("Severity / limit"), "cause middle"],
  ["trend", t("Trend"), "cause middle"],
  ["cost", t("Cost of waiting"), "cause number"],
  [null, t("Pumps"), "middle"],
  ["level", t("Level"), "middle"],
  ["flow", t("Flow, {unit}", { unit: "m³/h" }), "number wide"],
  ["power", t("Power, {unit}", { unit: "kW" }), "number wide"],
  ["gap", t("Gap"), "number wide"],
  ["alarms", t("Alarms"), "number middle"],
  [null, t("Last sample"), "wide"],
];

export function stationTable(order, choose) {
  const heads = COLUMNS.map(([name, word, kind]) => {
    const content = name ? html("button", { type: "button", "data-sort": name, onclick: () => choose(name) }, word) : word;
    return html("div", { role: "columnheader", class: kind, "data-sort": name ?? "" }, content);
  });
  const sheet = html("div", { class: "sheet", role: "presentation" });
  const window_ = html("div", { class: "window body", role: "rowgroup", tabindex: 0, "aria-label": t("Stations") }, sheet);
  const element = html("div", { class: "stations", role: "table", "aria-label": t("Stations") },
    html("div", { role: "rowgroup" }, html("div", { class: "line head", role: "row", "aria-rowindex": 1 }, ...heads)), window_);
  const empty = html("p", { class: "empty" }, t("No station."));
  const lines = [];
  let stations = [];
  let isLinked = true;

  function update() {
    const height = lineHeight();
    const { top } = window_.getBoundingClientRect(); // on a phone the page scrolls, else the table
    const first = Math.max(0, Math.floor((window_.scrollTop + Math.max(0, -top)) / height) - SPARE);
    const last = Math.min(stations.length, Math.ceil((window_.scrollTop + Math.min(window_.clientHeight, innerHeight - top)) / height) + SPARE);
    const wanted = Math.max(0, last - first);
    while (lines.length < wanted) {
      lines.push(stationLine());
      sheet.append(lines.at(-1).element);
    }
    while (lines.length > wanted) lines.pop().element.remove();
    lines.forEach((line, place) => line.show(stations[first + place], first + place, height, isLinked));
  }

  function lineHeight() {
    return (PHONE.matches ? 6.2 : 2.5) * parseFloat(getComputedStyle(document.documentElement).fontSize);
  }

  function show(wanted, sorted) {
    stations = wanted;
    mark(element, "aria-rowcount", stations.length + 1);
    sheet.style.height = `${stations.length * lineHeight()}px`;
    window_.style.maxHeight = `${Math.max(1, stations.length) * lineHeight() + 2}px`;
    for (const head of heads) {
      if (head.dataset.sort === sorted) head.setAttribute("aria-sort", sorted === "name" ? "ascending" : "descending");
      else head.removeAttribute("aria-sort");
    }
    if (stations.length) empty.remove();
    else window_.append(empty);
    update();
  }

  let isDue = false;
  function moved() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      update();
    });
  }
  window_.addEventListener("scroll", moved);
  document.addEventListener("scroll", moved);
  const size = new ResizeObserver(update);
  size.observe(window_);
  PHONE.addEventListener("change", update);
  return {
    element, show, update,
    /** Without a connection nothing that stands here is of now. */
    link(isThere) {
      if (isLinked === isThere) return;
      isLinked = isThere;
      update();
    },
    end() {
      size.disconnect();
      document.removeEventListener("scroll", moved);
      PHONE.removeEventListener("change", update);
    },
  };
}

function stationLine() {
  const word = html("span");
  const chip = html("span", { class: "state" }, word);
  const name = html("a", { href: "/" });
  const mode = html("span", { class: "note" });
  const pumps = pumpIcons();
  const fill = html("span", { class: "fill" });
  const level = html("span", { class: "value" });
  const cells = Object.fromEntries(["flow", "power", "gap", "alarms", "time", "cause", "stage", "since", "severity", "trend", "cost"].map((each) => [each, html("span")]));
  const cell = (kind, ...children) => html("div", { role: "cell", class: `cell ${kind}` }, ...children);
  const element = html("div", { class: "line", role: "row" },
    cell("", chip), cell("name", name, mode), cell("cause asset", cells.cause), cell("cause", cells.stage), cell("cause", cells.since), cell("cause middle", cells.severity), cell("cause middle", cells.trend), cell("cause number", cells.cost),
    cell("middle", pumps.element), cell("gauge middle", html("span", { class: "track", "aria-hidden": "true" }, fill), level),
    cell("number wide", cells.flow), cell("number wide", cells.power), cell("number wide", cells.gap), cell("number middle", cells.alarms), cell("wide", cells.time));
  let shown = "";

  function show(station, place, height, isLinked) {
    element.style.transform = `translateY(${place * height}px)`;
    mark(element, "aria-rowindex", place + 2);
    const kind = kindOfStation(station);
    if (shown !== `${station.state} ${kind}`) {
      shown = `${station.state} ${kind}`;
      chip.className = `state is-${kind}`;
      chip.dataset.state = station.state;
      chip.replaceChildren(icon(station.state), word);
      say(word, state(station.state).word);
    }
    if (name.textContent !== station.name) {
      name.textContent = station.name;
      name.href = `/station/${encodeURIComponent(station.name)}`;
    }
    say(mode, station.mode ? ` ${t(station.mode)}` : "");
    const [grade_, reason] = qualityOf(station, isLinked);
    pumps.show(station.pumps, station.running, station.names, grade_ === "good");
    const { floor } = station;
    const depth = ((station.levels[0] ?? floor + 2) - floor) * 1.2;
    fill.style.transform = `scaleX(${Math.min(1, Math.max(0, ((station.level ?? floor) - floor) / depth))})`;
    grade(fill, grade_, reason);
    const figures = { cause: causeWords(station), stage: stageWord(station), since: sinceWords(station), severity: severityShort(station), trend: trendWords(station), cost: costWords(station) };
    for (const [each, text] of Object.entries(figures)) {
      say(cells[each], text);
      grade(cells[each], text ? grade_ : "good", reason);
    }
    cells.stage.className = station.cause ? `is-${kind}` : "";
    for (const [node, value, text] of [[level, station.level, `${figure(station.level, 2)} m`], [cells.flow, station.flow, figure(station.flow, 0)], [cells.power, station.power, figure(station.power, 1)]]) {
      say(node, text);
      grade(node, value == null ? "never" : grade_, reason);
    }
    const gap = station.gap ? figure(station.gap.matters, 1) : "";
    say(cells.gap, station.gap?.doubled ? t("{size}, doubled", { size: gap }) : gap);
    cells.gap.className = station.gap?.doubled ? "is-urgent" : "";
    say(cells.alarms, station.alarms ? `${station.alarms}${station.unacknowledged ? ` (${t("{count} new", { count: station.unacknowledged })})` : ""}` : "");
    cells.alarms.className = station.unacknowledged ? "is-urgent" : "";
    say(cells.time, `${clock(station.time)}${reason ? `, ${reason}` : ""}`);
    grade(cells.time, grade_, reason);
  }
  return { element, show };
}

function qualityOf(station, isLinked) {
  if (station.time == null) return ["never", t("never seen")];
  if (!isLinked) return ["old", t("no connection")];
  if (station.stale) return ["old", t("old")];
  return station.quality === "good" ? ["good", ""] : ["bad", t("bad")];
}
