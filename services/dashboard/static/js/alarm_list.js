// Alarms in a table, with what an operator can do to each.

import { askAct } from "./alarm_act.js";
import { html, say } from "./dom.js";
import { millis, moment, words } from "./format.js";
import { icon } from "./states.js";
import { who } from "./who.js";

const PRIORITIES = ["urgent", "high", "medium", "low"];
const SHAPES = { urgent: "pump_and_system_fault", high: "pump_fault", medium: "system_fault", low: "sensor_fault" };
const KINDS = { urgent: "urgent", high: "urgent", medium: "gone", low: "sensor" };

const ACTS = {
  unacknowledged: ["acknowledge", "shelve"],
  acknowledged: ["shelve", "out_of_service"],
  returned: ["acknowledge", "shelve"],
  shelved: ["unshelve"],
  out_of_service: ["in_service"],
};

const open = (alarm) => alarm.state === "unacknowledged" || alarm.state === "returned";

function inOrder(alarms) {
  return [...alarms].sort((a, b) => open(b) - open(a) || PRIORITIES.indexOf(a.priority) - PRIORITIES.indexOf(b.priority) || (b.raised ?? "").localeCompare(a.raised ?? ""));
}

export function alarmList({ withStation }) {
  const body = html("tbody");
  const table = html("table", { class: "alarms" },
    html("thead", {}, html("tr", {}, ...["Priority", ...(withStation ? ["Station"] : []), "Alarm", "State", "Raised", "Do"].map((word) => html("th", { scope: "col" }, word)))), body);
  const empty = html("p", { class: "empty" }, "No alarm.");
  const element = html("div", {}, empty, table);
  const rows = new Map();

  function show(alarms) {
    empty.hidden = alarms.length > 0;
    table.hidden = alarms.length === 0;
    const wanted = new Set();
    for (const alarm of inOrder(alarms)) {
      const id = `${alarm.station} ${alarm.id}`;
      wanted.add(id);
      const content = JSON.stringify(alarm);
      const row = rows.get(id) ?? { element: html("tr", { "data-alarm": alarm.id }), content: "" };
      rows.set(id, row);
      if (row.content !== content) {
        const held = row.element.contains(document.activeElement) ? document.activeElement.dataset.act : null;
        row.content = content;
        row.element.replaceChildren(...cells(alarm, withStation));
        row.element.className = `alarm ${alarm.state}`;
        if (held) (row.element.querySelector("button") ?? document.getElementById("main")).focus();
      }
      body.append(row.element);
    }
    for (const [id, row] of rows) {
      if (!wanted.has(id)) {
        row.element.remove();
        rows.delete(id);
      }
    }
  }

  return { element, show };
}

function cells(alarm, withStation) {
  const failed = html("span", { class: "error", role: "alert" });
  const buttons = (who.role === "viewer" ? [] : (ACTS[alarm.state] ?? [])).map((act) =>
    html("button", { type: "button", "data-act": act, "aria-label": `${words(act)} ${alarm.text}`, onclick: () => askAct(alarm, act, (reason) => say(failed, reason)) }, words(act)));
  const kind = alarm.is_active ? KINDS[alarm.priority] : "calm";
  const until = alarm.until ? ` until ${moment(millis(alarm.until))}` : "";
  const by = alarm.by ? ` by ${alarm.by}` : "";
  return [
    html("td", {}, html("span", { class: `state is-${kind}` }, icon(SHAPES[alarm.priority], 14), html("span", {}, alarm.priority))),
    withStation ? html("td", {}, html("a", { href: `/station/${encodeURIComponent(alarm.station)}${alarm.pump > 1 ? `?pump=${alarm.pump}` : ""}` }, alarm.station)) : null,
    html("td", { class: "text" }, html("span", { class: "strong" }, alarm.text), alarm.advice ? html("span", { class: "note" }, ` ${alarm.advice}`) : null),
    html("td", {}, `${words(alarm.state)}${by}${until}`),
    html("td", {}, moment(millis(alarm.raised))),
    html("td", { class: "acts" }, html("span", { class: "buttons" }, ...buttons), failed),
  ].filter((cell) => cell);
}
