// The journal: every change of every alarm, newest first, as the historian kept it.

import { html, say } from "../base/dom.js";
import { millis, moment } from "../base/format.js";
import { t } from "../base/words.js";
import { priorityWord, stateWord, textOf } from "./alarm_words.js";

const SPANS = { "24h": [t("24 hours"), 24], "7d": [t("7 days"), 168], "90d": [t("90 days"), 2160], all: [t("all"), null] };
const AGAIN_MS = 10_000;

export function alarmJournal() {
  const span = html("select", { "aria-label": t("Time range") }, ...Object.entries(SPANS).map(([name, [word]]) => new Option(word, name, false, name === "all")));
  const note = html("p", { class: "note", role: "status" });
  const body = html("tbody");
  const table = html("table", { class: "journal" }, html("caption", { class: "unseen" }, t("Changes of alarms, newest first")),
    html("thead", {}, html("tr", {}, ...[t("Time"), t("Station"), t("Alarm"), t("Priority"), t("State"), t("By"), t("Comment")].map((word) => html("th", { scope: "col" }, word)))), body);
  const element = html("div", { hidden: true }, html("div", { class: "buttons" }, span, note), html("div", { class: "scroll" }, table));
  let found = [];
  let takes = () => true;
  let asked = -Infinity;
  span.addEventListener("change", load);

  async function load() {
    asked = performance.now();
    const hours = SPANS[span.value][1];
    const start = hours ? `?start=${new Date(Date.now() - hours * 3_600_000).toISOString()}` : "";
    try {
      const told = await (await fetch(`/api/alarms/journal${start}`)).json();
      if (told.error) throw new Error(told.error);
      found = told.lines;
      draw();
    } catch (error) {
      found = [];
      draw();
      say(note, t("No journal: {reason}", { reason: error.message }));
    }
  }

  function draw() {
    const lines = found.filter(takes);
    table.hidden = lines.length === 0;
    say(note, lines.length ? t("{count} changes", { count: lines.length }) : t("Nothing was kept of that time."));
    body.replaceChildren(...lines.map((alarm) => html("tr", {},
      html("td", {}, moment(millis(alarm.time))), html("td", {}, html("a", { href: `/station/${encodeURIComponent(alarm.station)}` }, alarm.station)), html("td", {}, textOf(alarm)),
      html("td", {}, priorityWord(alarm.priority)), html("td", {}, stateWord(alarm.state)), html("td", {}, alarm.by ?? ""), html("td", {}, alarm.reason))));
  }

  return {
    element,
    lines: () => found,
    show(wanted) {
      takes = wanted;
      if (performance.now() - asked > AGAIN_MS) load();
      else draw();
    },
  };
}
