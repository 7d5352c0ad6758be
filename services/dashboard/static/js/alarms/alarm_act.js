// Asks who does what to one or several alarms, and for how long or why; then asks the alarm service to do it.

import { html } from "../base/dom.js";
import { who } from "../base/who.js";
import { t } from "../base/words.js";
import { STATION, actWord, textOf } from "./alarm_words.js";

const NAME = "operator";
const MINUTES = [["15", t("15 minutes")], ["60", t("1 hour")], ["240", t("4 hours")], ["480", t("8 hours")], ["1440", t("1 day")]];

/** `tell(reason)` is called with what was not done; empty if all was. */
export function askAct(alarms, act, tell) {
  const by = html("input", { name: "by", required: true, maxlength: 64, autocomplete: "name", value: who.name ?? localStorage.getItem(NAME) ?? "", readonly: who.name !== null });
  const minutes = act === "shelve" ? html("select", { name: "minutes" }, ...MINUTES.map(([value, word]) => html("option", { value }, word))) : null;
  const reason = html("input", { name: "reason", maxlength: 500 });
  const dialog = html("dialog", { "aria-labelledby": "act-title" });
  const what = alarms.length === 1 ? (alarms[0].id === STATION ? alarms[0].text : textOf(alarms[0])) : t("{count} alarms", { count: alarms.length });
  const form = html("form", { method: "dialog" },
    html("h2", { id: "act-title" }, `${actWord(act)}: ${what}`),
    html("label", {}, t("Your name"), by),
    minutes ? html("label", {}, t("For"), minutes) : null,
    html("label", {}, act === "acknowledge" ? t("Comment") : t("Reason"), reason),
    html("div", { class: "buttons" },
      html("button", { type: "submit", class: "main" }, actWord(act)),
      html("button", { type: "button", onclick: () => dialog.close() }, t("cancel"))));
  form.addEventListener("submit", () => {
    localStorage.setItem(NAME, by.value);
    sendAll(alarms, { act, by: by.value, minutes: minutes ? Number(minutes.value) : null, reason: reason.value }, tell);
  });
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

async function sendAll(alarms, act, tell) {
  const refused = [];
  for (const alarm of alarms) {
    const reason = await send(alarm, act);
    if (reason) refused.push(alarms.length === 1 ? reason : `${alarm.station} ${alarm.id}: ${reason}`);
  }
  tell(refused.join("; "));
}

/** Why an act was not done; empty if it was. */
async function send(alarm, act) {
  const id = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  const order = { schema: "wetwell.alarm-act/1", id, station: alarm.station, alarm: alarm.id, ...act };
  try {
    const answer = await fetch(`/api/stations/${encodeURIComponent(alarm.station)}/alarm-act`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(order),
    });
    const told = await answer.json();
    return told.is_done ? "" : (told.error ?? told.reason);
  } catch {
    return t("no connection: nothing was done");
  }
}
