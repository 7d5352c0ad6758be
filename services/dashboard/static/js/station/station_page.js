// One station: all that is known of it, live or over one range of time.

import { query, remember } from "../base/address.js";
import { announce, html, say } from "../base/dom.js";
import { millis, moment, zone } from "../base/format.js";
import { pastOf } from "../base/past.js";
import { grade } from "../base/quality.js";
import { icon, isFault, state as look } from "../base/states.js";
import { follow } from "../base/stream.js";
import { t } from "../base/words.js";
import { alarmPanel } from "./alarm_panel.js";
import { causePanel } from "./cause_panel.js";
import { episodePanel } from "./episode_panel.js";
import { gapPanel } from "./gap_panel.js";
import { kpiPanel } from "./kpi_panel.js";
import { maintenancePanel } from "./maintenance_panel.js";
import { pastStore } from "./past_store.js";
import { planePanel } from "./plane_panel.js";
import { plantClock } from "./plant_clock.js";
import { qualityPanel } from "./quality_panel.js";
import { timeRange } from "./range.js";
import { StationState } from "./station_state.js";
import { trendPanel } from "./trend_panel.js";
import { wellPanel } from "./well_panel.js";

const PANELS = [wellPanel, planePanel, causePanel, trendPanel, episodePanel, alarmPanel, maintenancePanel, kpiPanel, gapPanel, qualityPanel];
const AGES_MS = 1000;

export function stationPage(name, main, showLink) {
  document.title = `${name} – wetwell`;
  const station = new StationState(name);
  let pump = Math.max(1, parseInt(query("pump", "1"), 10) || 1);
  const range = timeRange(() => station.time ?? station.kept, () => { past.load(); later(new Set(["range"])); });
  const past = pastStore(station, range, (names) => {
    station.lookAt(past.moment == null ? null : { verdicts: byPump(past.then), row: lastRow(past.runs, station.pumps) });
    later(names);
  });
  const view = { station, range, past, chosen: () => pump, choose };

  const word = html("span");
  const chip = html("span", { class: "state", id: "station-state" }, word);
  const time = html("span", { class: "note", id: "station-time" });
  const mode = html("span", { class: "strong", id: "station-mode", role: "status" });
  const choice = html("div", { class: "buttons", role: "group", "aria-label": t("Pump") });
  const clock = plantClock(station);
  const head = html("div", { class: "tools station-head" }, html("h1", {}, name), chip, mode, time, clock.element, choice, range.element);
  const unknown = html("div", { class: "absent", role: "alert", id: "unknown-station", hidden: true }, html("h1", {}, name),
    t("There is no station {name}: nothing was heard of it, and the historian does not know it.", { name }), " ", html("a", { href: "/" }, t("All stations")));
  const panels = PANELS.map((make) => make(view));
  const body = html("div", { class: "station" }, ...panels.map((each) => each.element));
  main.append(head, unknown, body);

  function choose(number) {
    pump = number;
    remember({ pump: number === 1 ? "" : number });
    update(new Set(["pump", "rows", "model", "verdicts"]));
  }

  let waiting = null;
  function later(changed) {
    if (waiting) {
      changed.forEach((each) => waiting.add(each));
      return;
    }
    waiting = changed;
    requestAnimationFrame(() => {
      const all = waiting;
      waiting = null;
      update(all);
    });
  }

  function update(changed) {
    const { kind, reason } = station.currency;
    if (chip.dataset.state !== station.state) {
      if (chip.dataset.state && isFault(station.state)) announce(`${name}: ${look(station.state).word}`);
      chip.dataset.state = station.state;
      chip.className = `state is-${look(station.state).kind}`;
      chip.replaceChildren(icon(station.state, 20), word);
      say(word, look(station.state).word);
    }
    grade(chip, station.state === "no_data" ? "good" : kind, reason); // "no data" says it itself
    grade(time, kind, reason);
    say(time, station.time ? `${moment(station.time)} ${zone(station.time)}${reason ? `, ${reason}` : ""}` : t("no sample yet"));
    say(mode, modeWords(station.mode));
    range.show();
    past.update();
    showChoice();
    clock.update();
    for (const each of panels) each.update(changed);
  }

  function showChoice() {
    while (choice.children.length < station.pumps) {
      const number = choice.children.length + 1;
      choice.append(html("button", { type: "button", onclick: () => choose(number) }));
    }
    [...choice.children].forEach((button, place) => {
      say(button, t("Pump {name}", { name: station.called(place + 1) }));
      button.setAttribute("aria-pressed", place + 1 === pump);
    });
  }

  function link(isThere) {
    station.currency.isLinked = isThere;
    showLink(isThere);
    later(new Set(["tick"]));
  }

  const end = follow(`/events?station=${encodeURIComponent(name)}`, `/api/stations/${encodeURIComponent(name)}`, {
    async begin(frame) {
      unknown.hidden = true;
      head.hidden = body.hidden = false;
      const isFirst = !station.begun;
      station.clear();
      const changed = station.take(frame);
      if (isFirst) {
        station.begun = true;
        if (!station.time) station.kept = await lastKept(name);
        past.load();
      }
      later(new Set([...changed, "begin", "verdicts", "alarms", "services"]));
    },
    apply: (frame) => later(station.take(frame)),
    link,
    missing() {
      unknown.hidden = false;
      head.hidden = body.hidden = true;
    },
  });
  const ages = setInterval(() => later(new Set(["tick"])), AGES_MS);
  return {
    move: range.read,
    end() {
      end();
      clearInterval(ages);
      for (const each of panels) each.end?.();
    },
  };
}

/** Why no alarm comes of faults: who has put the station into what, since when. */
function modeWords(told) {
  if (!told) return "";
  const reason = told.reason ? `: ${told.reason}` : "";
  return `${t(told.text)}${t(" by {name}", { name: told.by })}, ${t("since {time}", { time: moment(millis(told.raised)) })}${reason}`;
}

function byPump(verdicts) {
  const found = new Map();
  for (const verdict of verdicts) found.set(verdict.pump, [...(found.get(verdict.pump) ?? []), verdict]);
  return found;
}

/** Last row of columns, in the form of a live one. */
function lastRow({ times, columns }, pumps) {
  if (!times.length) return null;
  const of = (name) => columns[name]?.at(-1) ?? null;
  const values = Array.from({ length: pumps }, (_, place) => ["frequency_hz", "flow_m3h", "head_m", "power_kw"].map((name) => of(`pump${place + 1}_${name}`)));
  return [times.at(-1), of("level_m"), of("inflow_m3h"), ...values.flat()];
}

/** Time of the last sample that the historian has of a station, where nothing is heard of it. */
async function lastKept(name) {
  const [known] = await pastOf(name, "stations").then((told) => told.messages, () => []);
  return known?.last ? Date.parse(known.last) : undefined;
}
