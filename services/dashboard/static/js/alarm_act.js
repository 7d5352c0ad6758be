// Asks who does what to an alarm, and for how long or why; then asks the alarm service to do it.

import { html } from "./dom.js";
import { words } from "./format.js";
import { who } from "./who.js";

const NAME = "operator";
const MINUTES = [["15", "15 minutes"], ["60", "1 hour"], ["240", "4 hours"], ["480", "8 hours"], ["1440", "1 day"]];

export function askAct(alarm, act, tell) {
  const by = html("input", { name: "by", required: true, maxlength: 64, autocomplete: "name", value: who.name ?? localStorage.getItem(NAME) ?? "", readonly: who.name !== null });
  const minutes = act === "shelve" ? html("select", { name: "minutes" }, ...MINUTES.map(([value, word]) => html("option", { value }, word))) : null;
  const reason = act === "acknowledge" ? null : html("input", { name: "reason", maxlength: 500 });
  const dialog = html("dialog", { "aria-labelledby": "act-title" });
  const form = html("form", { method: "dialog" },
    html("h2", { id: "act-title" }, `${words(act)}: ${alarm.text}`),
    html("label", {}, "Your name", by),
    minutes ? html("label", {}, "For", minutes) : null,
    reason ? html("label", {}, "Reason", reason) : null,
    html("div", { class: "buttons" },
      html("button", { type: "submit", class: "main" }, words(act)),
      html("button", { type: "button", onclick: () => dialog.close() }, "cancel")));
  form.addEventListener("submit", () => {
    localStorage.setItem(NAME, by.value);
    send(alarm, { act, by: by.value, minutes: minutes ? Number(minutes.value) : null, reason: reason?.value ?? "" }, tell);
  });
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

async function send(alarm, act, tell) {
  const id = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  const order = { schema: "wetwell.alarm-act/1", id, station: alarm.station, alarm: alarm.id, ...act };
  try {
    const answer = await fetch(`/api/stations/${encodeURIComponent(alarm.station)}/alarm-act`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(order),
    });
    const told = await answer.json();
    tell(told.is_done ? "" : (told.error ?? told.reason));
  } catch {
    tell("no connection: nothing was done");
  }
}
