// Who looks at the page; asks for a token where one is needed.

import { html, say } from "./dom.js";
import { t } from "./words.js";

export const who = { asks: false, name: null, role: null };

/** Learns who looks; where a token is needed, waits until a right one was given. */
export async function learnWho() {
  try {
    Object.assign(who, await (await fetch("/api/who")).json());
  } catch {
    return; // the server is away: the page says so itself
  }
  if (who.asks && !who.name) await askToken();
}

function askToken() {
  return new Promise((resolve) => {
    const token = html("input", { type: "password", required: true, autocomplete: "current-password" });
    const told = html("p", { class: "error", role: "alert" });
    const dialog = html("dialog", { "aria-labelledby": "who-title" });
    const form = html("form", {}, html("h2", { id: "who-title" }, t("Who are you?")), html("label", {}, t("Token"), token), told,
      html("div", { class: "buttons" }, html("button", { type: "submit" }, t("enter"))));
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const answer = await fetch("/api/login", { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify({ token: token.value }) });
      if (answer.ok) Object.assign(who, await answer.json());
      if (!who.name) {
        say(told, t("This token is not known."));
        return;
      }
      dialog.remove();
      resolve();
    });
    dialog.addEventListener("cancel", (event) => event.preventDefault());
    dialog.append(form);
    document.body.append(dialog);
    dialog.showModal();
  });
}
