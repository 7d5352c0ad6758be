// Faults of the range as episodes: what was at fault, from when to when, how far it went, what to do, what it cost.

import { absence } from "../base/absent.js";
import { adviceWords } from "../base/advice.js";
import { html, panel, say } from "../base/dom.js";
import { csvOf, download } from "../base/export.js";
import { figure, millis, moment } from "../base/format.js";
import { episodesOf } from "../base/past.js";
import { STAGES, assetWords, chip, icon, kindOf, state } from "../base/states.js";
import { t } from "../base/words.js";
import { severityWords } from "./severity.js";

const DAY_MS = 86_400_000;
const LIVE_DAYS = 30;
const AGAIN_MS = 15_000;
const MOST_CHANGES = 40;

export function episodePanel({ station, range, past, choose }) {
  const away = absence("historian");
  const note = html("p", { class: "note", role: "status" });
  const body = html("tbody");
  const table = html("table", { class: "episodes", hidden: true },
    html("thead", {}, html("tr", {}, ...[t("At fault"), t("Stage"), t("From"), t("To"), t("Severity"), t("Cost of waiting"), t("Advice")].map((word) => html("th", { scope: "col" }, word)))), body);
  const changes = html("ol", { class: "changes", "aria-label": t("Changes of state, newest first") });
  const element = panel(t("Episodes"), away.element, note, html("div", { class: "scroll" }, table), html("details", {}, html("summary", {}, t("Changes of state")), changes));
  element.querySelector("header").append(html("button", { type: "button", onclick: exportShown }, t("download what is drawn")));
  element.classList.add("is-episodes");
  let episodes = [];
  let asked = -Infinity;
  let key = "";

  async function load() {
    const [from, to] = range.isLive ? [range.moment - LIVE_DAYS * DAY_MS, range.moment + 1] : range.limits();
    const mine = (key = `${range.isLive} ${from} ${to}`);
    asked = performance.now();
    try {
      const found = await episodesOf(station.name, from, to);
      if (mine === key) show(found);
    } catch (error) {
      if (mine !== key) return;
      table.hidden = true;
      say(note, t("No episodes: {reason}", { reason: error.message }));
    }
  }

  function show(found) {
    episodes = [...found].sort((a, b) => millis(b.from) - millis(a.from));
    table.hidden = episodes.length === 0;
    say(note, episodes.length ? "" : t("No episode in this time."));
    body.replaceChildren(...episodes.map(line));
  }

  function line(episode) {
    const stage = STAGES[episode.stage];
    const asset = assetWords(episode.asset, (number) => station.called(number));
    const pump = Number(episode.asset?.match(/^pump:(\d+)/)?.[1]);
    const look = () => {
      if (pump) choose(pump);
      const [from, to] = range.limits();
      const [first, last] = [millis(episode.from), episode.to ? millis(episode.to) : range.moment];
      if (range.isLive || first < from || last > to) range.between(first - 0.2 * (last - first) - 600_000, last + 0.2 * (last - first) + 600_000);
      else range.pick(last);
    };
    const costs = episode.cost == null ? "" : figure(episode.cost, 0);
    return html("tr", {},
      html("td", {}, html("button", { type: "button", class: `plain state is-${kindOf(episode)}`, onclick: look }, icon(episode.state, 14), html("span", {}, asset || state(episode.state).word))),
      html("td", {}, stage ? stage.word : state(episode.state).word), html("td", {}, moment(millis(episode.from))), html("td", {}, episode.to ? moment(millis(episode.to)) : t("still there")),
      html("td", {}, episode.severity ? severityWords(episode.severity) : ""), html("td", { class: "number" }, costs), html("td", { class: "note" }, episode.advice ? adviceWords(episode.advice) : ""));
  }

  function exportShown() {
    const names = ["asset", "state", "stage", "from", "to", "quantity", "value", "limit", "advice"];
    download(`${station.name}-episodes.csv`, csvOf(names, episodes.map((episode) => ({ ...episode, ...episode.severity }))));
  }

  function showChanges() {
    const found = past.bands.verdicts.slice(-MOST_CHANGES).reverse();
    const held = changes.contains(document.activeElement) ? [...changes.querySelectorAll("button")].indexOf(document.activeElement) : -1;
    changes.replaceChildren(...found.map((band) => html("li", {}, html("button", { type: "button", onclick: () => { choose(band.pump); range.pick(band.from); } },
      html("span", {}, t("Pump {name}", { name: station.called(band.pump) })), chip(band.state), html("span", { class: "note" }, moment(band.from))))));
    if (!found.length) changes.replaceChildren(html("li", { class: "empty" }, t("No verdict yet.")));
    if (held >= 0) changes.querySelectorAll("button")[held]?.focus();
  }

  return {
    element,
    update(changed) {
      away.show(station.has("historian"));
      if (changed.has("bands") || changed.has("model")) showChanges();
      const isOld = range.isOpen && performance.now() - asked > AGAIN_MS;
      if ((station.time ?? station.kept) && (changed.has("range") || changed.has("begin") || isOld)) load();
    },
  };
}
