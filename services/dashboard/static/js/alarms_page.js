// Alarms of all stations.

import { alarmList } from "./alarm_list.js";
import { html, say } from "./dom.js";
import { follow } from "./stream.js";

export function alarmsPage(main, showLink) {
  document.title = "Alarms – wetwell";
  const list = alarmList({ withStation: true });
  const count = html("span", { class: "note" });
  main.append(html("div", { class: "tools" }, html("h1", {}, "Alarms"), count), html("section", { class: "panel scroll", "aria-label": "Alarms" }, list.element));
  let isAsking = false;

  async function load() {
    if (isAsking) return;
    isAsking = true;
    try {
      const alarms = await (await fetch("/api/alarms")).json();
      list.show(alarms);
      say(count, `${alarms.filter((alarm) => alarm.state === "unacknowledged" || alarm.state === "returned").length} to acknowledge of ${alarms.length}`);
    } catch {
      showLink(false);
    } finally {
      isAsking = false;
    }
  }

  // The stream of the overview says when something other than a figure has changed.
  return follow("/events", "/api/stations", {
    begin: load,
    apply: (frame) => Object.keys(frame.stations).length && load(),
    link: showLink,
  });
}
