// What crews did and found: a form, and the log with what the detector saw of it.

import { askAct } from "../alarms/alarm_act.js";
import { actWord } from "../alarms/alarm_words.js";
import { html, panel, say } from "../base/dom.js";
import { ZONE, millis, moment } from "../base/format.js";
import { actsOf } from "../base/past.js";
import { assetWords } from "../base/states.js";
import { who } from "../base/who.js";
import { t } from "../base/words.js";
import { severityWords } from "./severity.js";

const NAME = "operator";
const AGAIN_MS = 30_000;
const SOON_MS = 500; // until the historian has kept the act that was entered
const ACTS = { pump: [t("pulled"), t("cleaned"), t("impeller replaced"), t("wear ring replaced")], main: [t("flushed"), t("vented"), t("valve opened")], sensor: [t("calibrated"), t("replaced"), t("cleaned")] };
const ENGLISH = { pump: ["pulled", "cleaned", "impeller replaced", "wear ring replaced"], main: ["flushed", "vented", "valve opened"], sensor: ["calibrated", "replaced", "cleaned"] };
const RESULTS = {
  pending: t("too few runs yet"), back: t("back to what it was"), better: t("better"), "no change": t("no change"),
  "learning anew": t("is learnt anew"), refused: t("refused"),
};
const METERS = ["flow_m3h", "head_m", "power_kw"];

export function maintenancePanel({ station }) {
  const asset = html("select", { required: true });
  const act = html("select", { required: true });
  const found = html("input", { maxlength: 500, placeholder: t("rags, deposits, nothing …") });
  const by = html("input", { required: true, maxlength: 64, autocomplete: "name", value: who.name ?? localStorage.getItem(NAME) ?? "", readonly: who.name !== null });
  const at = html("input", { type: "datetime-local" });
  const told = html("p", { class: "note", role: "status" });
  const form = html("form", { class: "entry" },
    html("label", {}, t("What"), asset), html("label", {}, t("Done"), act), html("label", {}, t("Found"), found), html("label", {}, t("By"), by),
    html("label", {}, t("When (empty: now)"), at), html("button", { type: "submit" }, t("enter the act")));
  const list = html("tbody");
  const log = html("table", { hidden: true }, html("thead", {}, html("tr", {}, ...[t("When"), t("What"), t("Done"), t("Found"), t("By"), t("Seen by the detector")].map((word) => html("th", { scope: "col" }, word)))), list);
  const modes = html("div", { class: "buttons", role: "group", "aria-label": t("Mode of the station") }, ...["maintenance", "stop", "resume"].map((name) =>
    html("button", { type: "button", "data-mode": name, onclick: () => askAct([{ id: "station", station: station.name, text: station.name }], name, (reason) => say(told, reason)) }, actWord(name))));
  const element = panel(t("Maintenance"), who.role === "viewer" ? html("p", { class: "note" }, t("You may look, not act.")) : html("div", {}, form, modes), told, html("div", { class: "scroll" }, log));
  element.classList.add("is-maintenance");
  let shown = "";
  let asked = -Infinity;
  let awaited = null;

  const kind = () => asset.value.split(":")[0];

  function showActs() {
    act.replaceChildren(...(ACTS[kind()] ?? []).map((word, place) => new Option(word, ENGLISH[kind()][place])));
  }
  asset.addEventListener("change", showActs);

  function showAssets() {
    const names = [...station.numbers.map((number) => `pump:${number}`), ...station.mains.map((name) => (name ? `main:${name}` : "main")), ...station.numbers.flatMap((number) => METERS.map((name) => `sensor:pump${number}_${name}`))];
    const labels = names.map((name) => assetWords(name, (number) => station.called(number)));
    if (shown === labels.join()) return;
    shown = labels.join();
    const held = asset.value;
    asset.replaceChildren(...names.map((name, place) => new Option(labels[place], name)));
    if (names.includes(held)) asset.value = held;
    showActs();
  }

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    localStorage.setItem(NAME, by.value);
    const body = { asset: asset.value, act: act.value, found: found.value, by: by.value };
    if (at.value) body.at = new Date(ZONE === "UTC" ? `${at.value}Z` : at.value).toISOString();
    try {
      const answer = await fetch(`/api/stations/${encodeURIComponent(station.name)}/maintenance`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
      const result = await answer.json().catch(() => ({ error: answer.statusText }));
      say(told, answer.ok && !result.error ? t("Entered.") : t("Not entered: {reason}", { reason: result.error ?? answer.statusText }));
      if (answer.ok) {
        found.value = "";
        awaited = result.id;
      }
      load();
    } catch {
      say(told, t("No connection: nothing was entered."));
    }
  });

  async function load() {
    asked = performance.now();
    try {
      const acts = await actsOf(station.name);
      if (acts.some(({ id }) => id === awaited)) awaited = null;
      log.hidden = acts.length === 0;
      list.replaceChildren(...[...acts].reverse().map((each) => html("tr", {},
        html("td", {}, moment(millis(each.time))), html("td", {}, assetWords(each.asset, (number) => station.called(number))), html("td", {}, t(each.act)), html("td", {}, each.found),
        html("td", {}, each.by), html("td", {}, resultWords(each)))));
    } catch (error) {
      log.hidden = true;
      say(told, t("The log cannot be read: {reason}", { reason: error.message }));
    }
  }

  function resultWords({ result, before, after }) {
    const sizes = before && after ? ` (${severityWords(before)} → ${severityWords(after)})` : "";
    return `${RESULTS[result] ?? result}${sizes}`;
  }

  return {
    element,
    update(changed) {
      if (station.pumps) showAssets();
      const mode = station.mode?.text ?? "";
      for (const button of modes.children) button.setAttribute("aria-pressed", { maintenance: "under maintenance", stop: "stopped", resume: "" }[button.dataset.mode] === mode);
      if (station.begun && (changed.has("begin") || performance.now() - asked > (awaited ? SOON_MS : AGAIN_MS))) load();
    },
  };
}
