// Distance of each judged run from the learnt curves, in standard deviations, with the thresholds.

import { chart } from "../base/chart.js";
import { html } from "../base/dom.js";
import { millis } from "../base/format.js";
import { t } from "../base/words.js";

const LIMIT = 3;
const SPLITS = [-1000, -300, -100, -30, -10, -3, 0, 3, 10, 30, 100, 300, 1000];

export function residualCharts({ station, chosen }) {
  const limits = () => [{ value: LIMIT, word: `+${LIMIT} σ` }, { value: -LIMIT, word: `−${LIMIT} σ` }];
  const range = (_, low, high) => [Math.min(-6, (low ?? 0) * 1.3), Math.max(6, (high ?? 0) * 1.3)];
  const splits = (_, __, low, high) => SPLITS.filter((value) => value >= low && value <= high);
  const points = { show: true, size: 4 };
  const sigmas = chart(t("Residuals of each run in standard deviations"), () => [
    { label: t("pump curve r_p"), pen: "pen1", points },
    { label: t("system curve r_s"), pen: "pen2", dash: [6, 3], points },
  ], { unit: t("shift, σ"), height: 170, limits, range, splits, scale: { distr: 4, asinh: LIMIT }, legend: true });
  const index = chart(t("Attribution index of each run"), () => [
    { label: "I_W", pen: "pen3", points },
    { label: t("system below"), pen: "steel", dash: [4, 4], width: 1 },
    { label: t("pump above"), pen: "steel", dash: [4, 4], width: 1 },
  ], { unit: "I_W", height: 110, range: () => [0, 1], legend: true });
  const empty = html("p", { class: "empty" }, t("No run was judged yet: the healthy station is being learnt."));
  const element = html("div", {}, html("h3", {}, t("Residuals of each run")), empty, sigmas.element, index.element);
  let isDue = true;

  /** Draws only while somebody sees it. */
  function update(changed, isSeen) {
    isDue ||= ["verdicts", "pump", "then", "begin"].some((name) => changed.has(name));
    if (!isDue || !isSeen) return;
    isDue = false;
    const told = (station.then ?? station.verdicts).get(chosen()) ?? [];
    const judged = told.filter((verdict) => verdict.evidence.shift_sigmas);
    empty.hidden = judged.length > 0;
    sigmas.element.hidden = index.element.hidden = judged.length === 0;
    if (!judged.length) return;
    const times = judged.map((verdict) => millis(verdict.time) / 1000);
    const of = (pick) => judged.map((verdict) => pick(verdict.evidence) ?? null);
    sigmas.update([times, of((evidence) => evidence.shift_sigmas.pump), of((evidence) => evidence.shift_sigmas.system)]);
    index.update([times, of((evidence) => evidence.index?.value), of((evidence) => evidence.index?.limits?.[0]), of((evidence) => evidence.index?.limits?.[1])]);
  }

  return {
    element,
    update,
    end() {
      sigmas.end();
      index.end();
    },
  };
}
