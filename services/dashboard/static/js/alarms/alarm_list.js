// Alarms in a table, with what an operator can do to each, or to several at once.

import { adviceWords } from "../base/advice.js";
import { html, say } from "../base/dom.js";
import { millis, moment } from "../base/format.js";
import { icon } from "../base/states.js";
import { who } from "../base/who.js";
import { t } from "../base/words.js";
import { askAct } from "./alarm_act.js";
import { KINDS, PRIORITIES, SHAPES, actWord, isOpen, priorityWord, stateWord, textOf } from "./alarm_words.js";

const ACTS = {
  unacknowledged: ["acknowledge", "shelve"],
  acknowledged: ["shelve", "out_of_service"],
  returned: ["acknowledge", "shelve"],
  latched_unacknowledged: ["acknowledge"],
  latched_acknowledged: ["reset"],
  shelved: ["unshelve"],
  out_of_service: ["in_service"],
};

const urgency = (alarm) => PRIORITIES.length - PRIORITIES.indexOf(alarm.priority);
const latest = (a, b) => (b.raised ?? "").localeCompare(a.raised ?? "");

export const ORDERS = {
  urgency: (a, b) => isOpen(b) - isOpen(a) || urgency(b) - urgency(a) || latest(a, b),
  station: (a, b) => a.station.localeCompare(b.station, undefined, { numeric: true }) || urgency(b) - urgency(a),
  state: (a, b) => isOpen(b) - isOpen(a) || a.state.localeCompare(b.state),
  raised: latest,
};

const COLUMNS = [["urgency", t("Priority")], ["station", t("Station")], [null, t("Alarm")], ["state", t("State")], ["raised", t("Raised")], [null, t("Do")]];

/** `chosen`: a set of names of alarms that are ticked, where several can be. */
export function alarmList({ withStation, chosen = null, onOrder = null, onChoose = () => {} }) {
  const body = html("tbody");
  const heads = COLUMNS.filter(([name]) => withStation || name !== "station").map(([name, word]) =>
    html("th", { scope: "col", "data-sort": name ?? "" }, onOrder && name ? html("button", { type: "button", class: "plain", onclick: () => onOrder(name) }, word) : word));
  const table = html("table", { class: "alarms" }, html("thead", {}, html("tr", {}, chosen ? html("th", { scope: "col" }, html("span", { class: "unseen" }, t("chosen"))) : null, ...heads)), body);
  const empty = html("p", { class: "empty" }, t("No alarm."));
  const element = html("div", {}, empty, table);
  const rows = new Map();

  /** Without a service that watches, an empty list is no good news, and is not told as such. */
  function show(alarms, { order = "urgency", isWatched = true } = {}) {
    empty.hidden = alarms.length > 0 || !isWatched;
    table.hidden = alarms.length === 0;
    const wanted = new Set();
    for (const head of heads) {
      if (onOrder && head.dataset.sort === order) head.setAttribute("aria-sort", order === "station" || order === "state" ? "ascending" : "descending");
      else head.removeAttribute("aria-sort");
    }
    for (const alarm of [...alarms].sort(ORDERS[order])) {
      const id = `${alarm.station} ${alarm.id}`;
      wanted.add(id);
      const content = JSON.stringify(alarm);
      const row = rows.get(id) ?? { element: html("tr", { "data-alarm": alarm.id }), content: "" };
      rows.set(id, row);
      if (row.content !== content) {
        const held = row.element.contains(document.activeElement);
        row.content = content;
        row.element.replaceChildren(...cells(alarm, id));
        row.element.className = `alarm ${alarm.state}`;
        if (held) (row.element.querySelector("button") ?? document.getElementById("main")).focus();
      }
      body.append(row.element);
    }
    for (const [id, row] of rows) {
      if (!wanted.has(id)) {
        row.element.remove();
        rows.delete(id);
        chosen?.delete(id);
      }
    }
  }

  function tick(alarm, id) {
    const box = html("input", { type: "checkbox", "aria-label": t("choose {what}", { what: `${alarm.station}: ${textOf(alarm)}` }), checked: chosen.has(id) });
    box.addEventListener("change", () => {
      if (box.checked) chosen.add(id);
      else chosen.delete(id);
      onChoose();
    });
    return html("td", { class: "tick" }, box);
  }

  function cells(alarm, id) {
    const failed = html("span", { class: "error", role: "alert" });
    const buttons = (who.role === "viewer" ? [] : (ACTS[alarm.state] ?? [])).map((act) =>
      html("button", { type: "button", "data-act": act, "aria-label": `${actWord(act)} ${textOf(alarm)}`, onclick: () => askAct([alarm], act, (reason) => say(failed, reason)) }, actWord(act)));
    const kind = alarm.is_active ? (KINDS[alarm.priority] ?? "calm") : "calm";
    const until = alarm.until ? t(" until {time}", { time: moment(millis(alarm.until)) }) : "";
    const by = alarm.by ? t(" by {name}", { name: alarm.by }) : "";
    return [
      chosen ? tick(alarm, id) : null,
      html("td", {}, html("span", { class: `state is-${kind}` }, icon(SHAPES[alarm.priority] ?? "unknown", 14), html("span", {}, priorityWord(alarm.priority)))),
      withStation ? html("td", {}, html("a", { href: `/station/${encodeURIComponent(alarm.station)}${alarm.pump > 1 ? `?pump=${alarm.pump}` : ""}` }, alarm.station)) : null,
      html("td", { class: "text" }, html("span", { class: "strong" }, textOf(alarm)), alarm.advice ? html("span", { class: "note" }, ` ${adviceWords(alarm.advice)}`) : null),
      html("td", {}, `${stateWord(alarm.state)}${by}${until}${alarm.reason ? `: ${alarm.reason}` : ""}`),
      html("td", {}, moment(millis(alarm.raised))),
      html("td", { class: "acts" }, html("span", { class: "buttons" }, ...buttons), failed),
    ].filter((cell) => cell);
  }

  return { element, show };
}
