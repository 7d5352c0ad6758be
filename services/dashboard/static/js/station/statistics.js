// What a verdict rests on: probabilities, both tests of the paper, shifts and signals.

import { html } from "../base/dom.js";
import { figure, millis, moment, percent, signed, words } from "../base/format.js";
import { STATES, chip } from "../base/states.js";
import { t } from "../base/words.js";
import { bar } from "./money.js";
import { QUANTITIES } from "./severity.js";

export function statisticsOf(verdict) {
  return [
    html("h3", {}, chip(verdict.state)),
    html("p", { class: "note" }, t("told {time}, from {start}", { time: moment(millis(verdict.time)), start: moment(millis(verdict.window[0])) })),
    probabilities(verdict.probability),
    html("dl", { class: "figures" }, ...[...facts(verdict)].flatMap(([name, value]) => [html("dt", {}, name), html("dd", {}, value)])),
  ];
}

function probabilities(probability) {
  const rows = Object.entries(probability).sort(([, a], [, b]) => b - a).map(([name, share]) =>
    html("tr", {}, html("th", { scope: "row" }, STATES[name]?.word ?? name),
      html("td", { class: "share" }, bar(share)),
      html("td", { class: "number" }, percent(share))));
  return html("table", { class: "posterior" }, html("caption", {}, t("Probability")), html("tbody", {}, ...rows));
}

function* facts({ evidence, onset }) {
  if (evidence.reason) yield [t("reason"), evidence.reason];
  if (onset) yield [t("onset"), moment(millis(onset))];
  for (const [name, { word, unit, digits }] of Object.entries(QUANTITIES)) {
    const value = evidence.severity?.[name];
    if (value) yield [word, `${signed(value.value, digits)} ${unit} (${signed(value.interval[0], digits)} ${t("to")} ${signed(value.interval[1], digits)})`];
  }
  if (evidence.shift_m) {
    const sigmas = evidence.shift_sigmas ?? {};
    yield [t("pump curve"), `${signed(evidence.shift_m.pump)} m, ${signed(sigmas.pump, 1)} σ`];
    yield [t("system curve"), `${signed(evidence.shift_m.system)} m, ${signed(sigmas.system, 1)} σ`];
    for (const name of ["drawdown", "power"]) if (name in sigmas) yield [t(name), `${signed(sigmas[name], 1)} σ`];
  }
  for (const [name, test] of Object.entries(evidence.f_test ?? {})) {
    yield [t("F-test, {name}", { name: t(name) }), t("F {f}, p {p}, {samples} samples", { f: figure(test.f, 2), p: chance(test.log_p), samples: test.samples })];
  }
  const index = evidence.index ?? evidence.tangent;
  if (index) {
    const limits = index.limits ? t("; limits {low} and {high}", { low: figure(index.limits[0], 2), high: figure(index.limits[1], 2) }) : "";
    const says = index.says ? t("; says {what}", { what: t(index.says) }) : "";
    yield ["I_W", `${figure(index.value, 2)} (${figure(index.interval[0], 2)} ${t("to")} ${figure(index.interval[1], 2)})${limits}${says}`];
  }
  for (const name of ["missing", "stuck", "dead", "lost", "noisy"]) if (evidence[name]?.length) yield [`${words(name)}`, evidence[name].join(", ")];
  if (evidence.signals) yield [t("rests on"), evidence.signals.join(", ")];
  if (evidence.steady_samples != null) yield [t("steady samples"), String(evidence.steady_samples)];
  if (evidence.baseline != null) yield [t("baseline"), t("version {number}", { number: evidence.baseline })];
}

function chance(logP) {
  if (logP == null) return "–";
  const exponent = logP / Math.LN10;
  return exponent < -4 ? `1e${exponent.toFixed(0)}` : figure(Math.exp(logP), 4);
}
