// Alarms of all stations: those that stand, those put aside, and the journal; filtered, sorted, acknowledged together.

import { absence } from "../base/absent.js";
import { query, remember } from "../base/address.js";
import { html, mark, say } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { follow } from "../base/stream.js";
import { who } from "../base/who.js";
import { t } from "../base/words.js";
import { askAct } from "./alarm_act.js";
import { ORDERS, alarmList } from "./alarm_list.js";
import { PRIORITIES, isOpen, isPutAside, priorityWord, ruleWord, textOf } from "./alarm_words.js";
import { alarmJournal } from "./journal.js";

const TABS = {
  standing: { word: t("standing"), takes: (alarm) => !isPutAside(alarm) },
  open: { word: t("to acknowledge"), takes: isOpen },
  aside: { word: t("shelved and out of service"), takes: isPutAside },
  journal: { word: t("journal"), takes: () => false },
};

export function alarmsPage(main, showLink) {
  document.title = `${t("Alarms")} – wetwell`;
  let tab = query("show") in TABS ? query("show") : "standing";
  let order = query("sort") in ORDERS ? query("sort") : "urgency";
  let priority = PRIORITIES.includes(query("priority")) ? query("priority") : "";
  let find = query("find");
  let alarms = [];
  const chosen = new Set();

  const away = absence("alarms");
  const count = html("span", { class: "note" });
  const counts = {};
  const tabs = Object.entries(TABS).map(([name, { word }]) => {
    counts[name] = html("span", { class: "number" });
    return html("button", { type: "button", "data-tab": name, onclick: () => choose({ show: (tab = name) === "standing" ? "" : name }) }, `${word} `, counts[name]);
  });
  const priorities = html("select", { "aria-label": t("Priority") }, new Option(t("all priorities"), ""), ...PRIORITIES.map((name) => new Option(priorityWord(name), name, false, name === priority)));
  priorities.addEventListener("change", () => choose({ priority: (priority = priorities.value) }));
  const search = html("input", { type: "search", placeholder: t("Find a station or an alarm"), "aria-label": t("Find a station or an alarm"), value: find });
  search.addEventListener("input", () => choose({ find: (find = search.value) }));
  const failed = html("span", { class: "error", role: "alert" });
  const all = html("button", { type: "button", id: "choose-open", onclick: chooseOpen }, t("choose all to acknowledge"));
  const together = html("button", { type: "button", id: "acknowledge-chosen", disabled: true, onclick: () => askAct(chosenAlarms(), "acknowledge", (reason) => say(failed, reason)) }, t("acknowledge {count} chosen", { count: 0 }));
  const list = alarmList({ withStation: true, chosen: who.role === "viewer" ? null : chosen, onChoose: showChosen, onOrder: (name) => choose({ sort: (order = name) === "urgency" ? "" : name }) });
  const journal = alarmJournal();
  const bulk = html("div", { class: "buttons" }, all, together, failed);
  const section = html("section", { class: "panel", "aria-label": t("Alarms") }, away.element, who.role === "viewer" ? null : bulk, html("div", { class: "scroll" }, list.element), journal.element);
  main.append(
    html("div", { class: "tools" }, html("h1", {}, t("Alarms")), html("div", { class: "filters", role: "group", "aria-label": t("Which alarms") }, ...tabs), priorities, search,
      html("button", { type: "button", onclick: exportShown }, t("download what is drawn")), count), section);

  function choose(changes) {
    remember(changes);
    show();
  }

  const takes = (alarm) => (!priority || alarm.priority === priority) && `${alarm.station} ${alarm.id} ${textOf(alarm)}`.toLowerCase().includes(find.toLowerCase());
  const shown = () => (tab === "journal" ? journal.lines() : alarms.filter(TABS[tab].takes)).filter(takes);
  const chosenAlarms = () => shown().filter((alarm) => isOpen(alarm) && chosen.has(`${alarm.station} ${alarm.id}`));

  function chooseOpen() {
    for (const alarm of shown().filter(isOpen)) chosen.add(`${alarm.station} ${alarm.id}`);
    for (const box of list.element.querySelectorAll("input[type=checkbox]")) box.checked = chosen.has(`${box.closest("tr").querySelector("a").textContent} ${box.closest("tr").dataset.alarm}`);
    showChosen();
  }

  function showChosen() {
    const number = chosenAlarms().length;
    say(together, t("acknowledge {count} chosen", { count: number }));
    together.disabled = number === 0;
  }

  function show() {
    for (const button of tabs) mark(button, "aria-pressed", button.dataset.tab === tab);
    for (const [name, { takes: of }] of Object.entries(TABS)) say(counts[name], name === "journal" ? "" : String(alarms.filter(of).length));
    const isJournal = tab === "journal";
    list.element.hidden = bulk.hidden = isJournal;
    journal.element.hidden = !isJournal;
    if (isJournal) journal.show(takes);
    else list.show(shown(), { order, isWatched: away.element.hidden });
    all.disabled = !shown().some(isOpen);
    say(count, t("{open} to acknowledge of {all}", { open: alarms.filter(isOpen).length, all: alarms.length }));
    showChosen();
  }

  function exportShown() {
    const names = ["station", "id", "kind", "priority", "state", "raised", "returned", "acknowledged", "by", "reason", "text"];
    download("alarms.csv", csvOf(names, shown().map((alarm) => ({ ...alarm, kind: ruleWord(alarm) }))));
  }

  let isAsking = false;
  async function load() {
    if (isAsking) return;
    isAsking = true;
    try {
      const [told, health] = await Promise.all(["/api/alarms", "/api/health"].map(async (address) => (await fetch(address)).json()));
      alarms = told;
      away.show(health.services.some((each) => each.service === "alarms" && each.is_alive));
      show();
    } catch {
      showLink(false);
    } finally {
      isAsking = false;
    }
  }

  // The stream of the overview says when something other than a figure has changed.
  const end = follow("/events", "/api/stations", {
    begin: load,
    apply: (frame) => Object.keys(frame.stations).length && load(),
    link: showLink,
  });
  const look = setInterval(() => document.hidden || load(), 5000);
  return {
    end() {
      clearInterval(look);
      end();
    },
  };
}
