// Alarms of one station: those that stand, and of a range of the past those that stood in it.

import { alarmList } from "../alarms/alarm_list.js";
import { priorityWord, textOf } from "../alarms/alarm_words.js";
import { absence } from "../base/absent.js";
import { html, panel } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { lasting, moment } from "../base/format.js";
import { t } from "../base/words.js";

export function alarmPanel({ station, range, past }) {
  const away = absence("alarms");
  const list = alarmList({ withStation: false });
  const rows = html("tbody");
  const table = html("table", { hidden: true }, html("caption", {}, t("Alarms of the range")),
    html("thead", {}, html("tr", {}, ...[t("Alarm"), t("Priority"), t("Raised"), t("Lasted")].map((word) => html("th", { scope: "col" }, word)))), rows);
  const element = panel(t("Alarms"), away.element, html("div", { class: "scroll" }, list.element, table));
  element.querySelector("header").append(html("button", { type: "button", onclick: exportShown }, t("download what is drawn")));
  element.classList.add("is-alarms");
  let bands = [];

  const listed = () => [...station.alarms.values()].filter((alarm) => alarm.state !== "normal");

  function exportShown() {
    const iso = (ms) => (ms == null ? "" : new Date(ms).toISOString());
    const standing = listed().map(({ id, raised, returned, ...alarm }) => ({ ...alarm, alarm: id, from: raised, to: returned }));
    const past_ = table.hidden ? [] : bands.filter((band) => band.to != null).map(({ id, from, to, ...band }) => ({ ...band, state: "", alarm: id, from: iso(from), to: iso(to) }));
    download(`${station.name}-alarms.csv`, csvOf(["alarm", "priority", "state", "from", "to", "text"], [...standing, ...past_]));
  }

  function showRange() {
    const [from, to] = range.limits();
    bands = past.bands.alarms.filter((band) => band.from < to && (band.to ?? Infinity) > from).reverse();
    table.hidden = range.isLive || !bands.length;
    if (table.hidden) return;
    rows.replaceChildren(...bands.slice(0, 100).map((band) => html("tr", {},
      html("td", {}, html("button", { type: "button", class: "plain", onclick: () => range.pick(Math.min(to, Math.max(from, band.from))) }, textOf(band))), html("td", {}, priorityWord(band.priority)),
      html("td", {}, moment(band.from)), html("td", {}, band.to ? lasting((band.to - band.from) / 1000) : t("still there")))));
  }

  return {
    element,
    update(changed) {
      const isThere = station.has("alarms");
      away.show(isThere);
      if (["alarms", "services", "begin"].some((name) => changed.has(name))) list.show(listed(), { isWatched: isThere });
      if (changed.has("bands") || changed.has("range")) showRange();
    },
  };
}
