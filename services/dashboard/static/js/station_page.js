// One station: everything that is known of it, live.

import { query, remember } from "./address.js";
import { alarmPanel } from "./alarm_panel.js";
import { announce, html, say } from "./dom.js";
import { moment } from "./format.js";
import { historyPanel } from "./history_panel.js";
import { kpiPanel } from "./kpi_panel.js";
import { livePanel } from "./live_panel.js";
import { planePanel } from "./plane_panel.js";
import { plantClock } from "./plant_clock.js";
import { qualityPanel } from "./quality_panel.js";
import { residualPanel } from "./residual_panel.js";
import { StationState } from "./station_state.js";
import { icon, isFault, state as look } from "./states.js";
import { follow } from "./stream.js";
import { verdictPanel } from "./verdict_panel.js";
import { wellPanel } from "./well_panel.js";

export function stationPage(name, main, showLink) {
  document.title = `${name} – wetwell`;
  const station = new StationState(name);
  let pump = Math.max(1, parseInt(query("pump", "1"), 10) || 1);

  const word = html("span");
  const chip = html("span", { class: "state", id: "station-state" }, word);
  const time = html("span", { class: "note", id: "station-time" });
  const choice = html("div", { class: "buttons", role: "group", "aria-label": "Pump" });
  const clock = plantClock(station);
  const head = html("div", { class: "tools" },
    html("h1", {}, name), chip, time, clock.element, choice);
  const panels = [wellPanel, planePanel, alarmPanel, livePanel, verdictPanel, residualPanel, kpiPanel, historyPanel, qualityPanel]
    .map((make) => make(station, () => pump, choose));
  main.append(head, html("div", { class: "station" }, ...panels.map((each) => each.element)));

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
    if (chip.dataset.state !== station.state) {
      if (chip.dataset.state && isFault(station.state)) announce(`${name}: ${look(station.state).word}`);
      chip.dataset.state = station.state;
      chip.className = `state is-${look(station.state).kind}`;
      chip.replaceChildren(icon(station.state, 20), word);
      say(word, look(station.state).word);
    }
    say(time, station.time ? `${moment(station.time)} UTC${station.stale ? ", no samples now" : ""}` : "no sample yet");
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
      say(button, `Pump ${station.called(place + 1)}`);
      button.setAttribute("aria-pressed", place + 1 === pump);
    });
  }

  const end = follow(`/events?station=${encodeURIComponent(name)}`, `/api/stations/${encodeURIComponent(name)}`, {
    begin(frame) {
      station.clear();
      later(new Set([...station.take(frame), "begin", "verdicts", "alarms", "services"]));
    },
    apply: (frame) => later(station.take(frame)),
    link: showLink,
  });
  return () => {
    end();
    for (const each of panels) each.end?.();
  };
}
