// What is wrong: a sentence, a picture and the money first; the statistics that it rests on are folded below.

import { absence } from "../base/absent.js";
import { html, panel, say } from "../base/dom.js";
import { day, figure, millis, moment } from "../base/format.js";
import { grade } from "../base/quality.js";
import { STAGES, assetOf, assetWords, icon, isFault, kindOf, stageOf, state } from "../base/states.js";
import { t } from "../base/words.js";
import { moneyOf } from "./money.js";
import { residualCharts } from "./residual_charts.js";
import { severityOf, severityPicture, severityWords } from "./severity.js";
import { statisticsOf } from "./statistics.js";

export function causePanel(view) {
  const { station, range, past, chosen, choose } = view;
  const away = absence("detector");
  const causes = html("div", { class: "causes", role: "group", "aria-label": t("What is at fault") });
  const words = html("p", { class: "sentence" });
  const picture = html("div");
  const money = html("div");
  const statistics = html("div", { class: "evidence" });
  const residuals = residualCharts(view);
  const fold = html("details", {}, html("summary", {}, t("Statistics")), statistics, residuals.element);
  const element = panel(t("What is wrong"), away.element, causes, words, picture, money, fold);
  element.classList.add("is-cause");
  fold.addEventListener("toggle", () => residuals.update(new Set(), fold.open));
  let shown = "";

  function update(changed) {
    away.show(station.has("detector") || !range.isLive || !station.begun);
    grade(element, station.then || (station.has("detector") && station.currency.kind === "good") ? "good" : "old", station.has("detector") ? station.currency.reason : t("The detector is not running"));
    residuals.update(changed, fold.open);
    if (!["verdicts", "pump", "model", "begin", "then", "range"].some((name) => changed.has(name))) return;
    const verdict = station.verdict(chosen());
    const key = JSON.stringify([verdict?.time, verdict?.state, chosen(), station.causes.map((each) => [each.time, each.pump]), station.called(chosen()), Boolean(station.then)]);
    if (key === shown) return;
    shown = key;
    showCauses();
    const isOpen = fold.open;
    say(element.querySelector("h2"), t("What is wrong, pump {name}", { name: station.called(chosen()) }));
    say(words, verdict ? sentence(verdict) : past.then.length || station.verdicts.size ? t("No verdict on this pump.") : t("No verdict yet."));
    picture.replaceChildren(...(verdict && severityOf(verdict) ? [severityPicture(verdict)] : []));
    money.replaceChildren(...(verdict ? moneyOf(verdict) : []));
    statistics.replaceChildren(...(verdict ? statisticsOf(verdict) : []));
    fold.hidden = !verdict;
    fold.open = isOpen;
  }

  /** One button for each thing that is at fault: one cause is one, however many pumps feel it. */
  function showCauses() {
    const held = causes.contains(document.activeElement);
    causes.replaceChildren(...station.causes.map((verdict) => {
      const stage = stageOf(verdict);
      const asset = assetWords(assetOf(verdict), (number) => station.called(number));
      return html("button", { type: "button", class: `cause is-${kindOf(verdict)}`, "data-asset": assetOf(verdict), "aria-pressed": assetOf(verdict) === ownAsset(), onclick: () => choose(verdict.pump) },
        icon(verdict.state, 16), html("span", {}, `${asset}: ${stage ? stage.word : state(verdict.state).word}`));
    }));
    causes.hidden = station.causes.length === 0;
    if (held) causes.querySelector("button")?.focus();
  }

  function ownAsset() {
    const verdict = station.verdict(chosen());
    return verdict && isFault(verdict.state) ? assetOf(verdict) : null;
  }

  function sentence(verdict) {
    const asset = assetWords(assetOf(verdict), (number) => station.called(number));
    if (!isFault(verdict.state)) {
      const reason = verdict.evidence?.reason ? ` (${t(verdict.evidence.reason)})` : "";
      return { normal: t("Pump {name} and its main are as they were learnt.", { name: station.called(verdict.pump) }), learning: t("The healthy station is being learnt.") }[verdict.state] ?? t("Not enough is known to judge") + `${reason}.`;
    }
    const parts = [t("{asset} is at fault since {time}", { asset: asset.charAt(0).toUpperCase() + asset.slice(1), time: moment(millis(verdict.onset ?? verdict.time)) })];
    if (verdict.state === "pump_and_system_fault") parts.push(t("and so is the main"));
    const severity = severityOf(verdict);
    if (severity) parts.push(severityWords(severity));
    const { trend } = verdict;
    if (trend) parts.push(t("it grows by {value} a day", { value: figure(trend.per_day, 2) }));
    if (trend?.reaches_limit) parts.push(t("the limit is reached on {day}{interval}", { day: day(millis(trend.reaches_limit)), interval: trend.interval_at?.every(Boolean) ? ` (${day(millis(trend.interval_at[0]))} – ${day(millis(trend.interval_at[1]))})` : "" }));
    const stage = STAGES[verdict.stage];
    return `${parts.join(", ")}.${stage ? ` ${stage.word.charAt(0).toUpperCase()}${stage.word.slice(1)}: ${stage.says}.` : ""}`;
  }

  return { element, update, end: residuals.end };
}
