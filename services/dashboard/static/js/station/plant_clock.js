// The clock of a simulated plant: how fast it runs, with a button that holds it. A real station shows nothing here.

import { html, say } from "../base/dom.js";
import { t } from "../base/words.js";

const STEPS = [1, 10, 60, 600];

export function plantClock(station) {
  const held = html("button", { type: "button", onclick: () => order({ is_held: !isHeld() }) });
  const speed = html("select", { "aria-label": t("Speed of the plant"), onchange: () => order({ speed: Number(speed.value) }) });
  const told = html("span", { class: "error", role: "alert" });
  const element = html("div", { class: "buttons", role: "group", "aria-label": t("Clock of the simulated plant"), hidden: true }, held, speed, told);

  const figures = () => station.statuses.get("simulator")?.figures;
  const isHeld = () => figures()?.held > 0;

  async function order(change) {
    const order = { schema: "wetwell.plant-clock-order/1", ...change };
    try {
      const answer = await fetch(`/api/stations/${encodeURIComponent(station.name)}/plant-clock`, {
        method: "POST",
        headers: { "content-type": "application/json" },
        body: JSON.stringify(order),
      });
      say(told, answer.ok ? "" : (await answer.json()).error);
    } catch {
      say(told, t("the page's server does not answer"));
    }
  }

  function update() {
    const now = figures();
    element.hidden = !station.alive.includes("simulator") || !(now?.full_speed > 1);
    if (element.hidden) return;
    say(held, isHeld() ? t("go on") : t("hold"));
    held.setAttribute("aria-pressed", isHeld());
    const steps = [...STEPS.filter((step) => step < now.full_speed), now.full_speed];
    if (speed.children.length !== steps.length) speed.replaceChildren(...steps.map((step) => html("option", { value: step }, t("{speed} × life", { speed: step }))));
    if (document.activeElement !== speed) speed.value = String(steps.findLast((step) => step <= now.speed) ?? steps[0]);
  }

  return { element, update };
}
