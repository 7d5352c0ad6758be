// What is wrong: a sentence, a picture and the money first; the statistics that it rests on are folded below.

import { absence } from "../base/absent.js";
import { html, panel, say } from "../base/dom.js";
import { millis, moment } from "../base/format.js";
import { grade } from "../base/quality.js";
import { STAGES, assetWords, icon, kindOf, stageOf, state } from "../base/states.js";
import { t } from "../base/words.js";
import { moneyOf } from "./money.js";
import { residualCharts } from "./residual_charts.js";
import { severityPicture, sizeWords } from "./severity.js";
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
  let asset = null; // the one that somebody has chosen among several

  function update(changed) {
    away.show(station.has("detector") || !range.isLive || !station.begun);
    grade(element, station.then || (station.has("detector") && station.currency.kind === "good") ? "good" : "old", station.has("detector") ? station.currency.reason : t("The detector is not running"));
    residuals.update(changed, fold.open);
    if (!["verdicts", "pump", "model", "begin", "then", "range"].some((name) => changed.has(name))) return;
    const verdict = station.verdict(chosen());
    const key = JSON.stringify([verdict?.time, verdict?.state, asset, chosen(), station.causes.map(({ fault, pump }) => [fault, pump]), station.called(chosen()), Boolean(station.then)]);
    if (key === shown) return;
    shown = key;
    showCauses();
    const isOpen = fold.open;
    say(element.querySelector("h2"), t("What is wrong, pump {name}", { name: station.called(chosen()) }));
    const fault = shownFault(verdict);
    say(words, verdict ? sentence(verdict, fault) : past.then.length || station.verdicts.size ? t("No verdict on this pump.") : t("No verdict yet."));
    picture.replaceChildren(...(fault?.severity ? [severityPicture(fault)] : []));
    money.replaceChildren(...(verdict ? moneyOf(verdict, fault) : []));
    statistics.replaceChildren(...(verdict ? statisticsOf(verdict) : []));
    fold.hidden = !verdict;
    fold.open = isOpen;
  }

  /** One button for each thing that is at fault: one cause is one, however many pumps feel it. */
  function showCauses() {
    const held = causes.contains(document.activeElement);
    const own = shownFault(station.verdict(chosen()))?.asset;
    causes.replaceChildren(...station.causes.map(({ fault, pump }) => {
      const words_ = assetWords(fault.asset, (number) => station.called(number));
      return html("button", { type: "button", class: `cause is-${kindOf(fault)}`, "data-asset": fault.asset, "aria-pressed": fault.asset === own, onclick: () => look(fault, pump) },
        icon(fault.state, 16), html("span", {}, `${words_}: ${(stageOf(fault) ?? state(fault.state)).word}`));
    }));
    causes.hidden = station.causes.length === 0;
    if (held) causes.querySelector("button")?.focus();
  }

  function look(fault, pump) {
    asset = fault.asset;
    choose(station.faults(chosen()).some((each) => each.asset === asset) ? chosen() : pump);
  }

  /** The fault that is told of: the one that was chosen, else the worst of the pump. */
  function shownFault(verdict) {
    const faults = verdict ? station.faults(verdict.pump) : [];
    return faults.find((each) => each.asset === asset) ?? faults[0];
  }

  function sentence(verdict, fault) {
    if (!fault) {
      const reason = verdict.evidence?.reason ? ` (${verdict.evidence.reason})` : "";
      return { normal: t("Pump {name} and its main are as they were learnt.", { name: station.called(verdict.pump) }), learning: t("The healthy station is being learnt.") }[station.pumpState(verdict.pump)] ?? `${t("Not enough is known to judge")}${reason}.`;
    }
    const words_ = assetWords(fault.asset, (number) => station.called(number));
    const parts = [t("{asset} is at fault since {time}", { asset: words_.charAt(0).toUpperCase() + words_.slice(1), time: moment(millis(fault.since)) }), ...sizeWords(fault)];
    const stage = STAGES[fault.stage];
    return `${parts.join(", ")}.${stage ? ` ${stage.word.charAt(0).toUpperCase()}${stage.word.slice(1)}: ${stage.says}.` : ""}`;
  }

  return { element, update, end: residuals.end };
}
