// Why a verdict says what it says: probabilities, both tests of the paper, severity, advice, costs.

import { html } from "./dom.js";
import { figure, millis, moment, percent, signed, words } from "./format.js";
import { STATES, chip } from "./states.js";

const SEVERITY = {
  speed_loss_percent: ["loss of speed", "%", 1],
  friction_rise_percent: ["more friction", "%", 1],
  static_head_rise_m: ["or more static head", "m", 2],
};

export function evidenceOf(verdict) {
  const { evidence } = verdict;
  return [
    html("h3", {}, chip(verdict.state)),
    html("p", { class: "note" }, `told ${moment(millis(verdict.time))}, from ${moment(millis(verdict.window[0]))}`),
    evidence.advice ? html("p", { class: "advice" }, evidence.advice) : null,
    probabilities(verdict.probability),
    html("dl", { class: "figures" }, ...facts(verdict).flatMap(([name, value]) => [html("dt", {}, name), html("dd", {}, value)])),
  ].filter((part) => part);
}

function probabilities(probability) {
  const rows = Object.entries(probability).sort(([, a], [, b]) => b - a).map(([name, share]) =>
    html("tr", {}, html("th", { scope: "row" }, STATES[name]?.word ?? name),
      html("td", { class: "share" }, bar(share)),
      html("td", { class: "number" }, percent(share))));
  return html("table", { class: "posterior" }, html("caption", {}, "Probability"), html("tbody", {}, ...rows));
}

function bar(share) {
  const element = html("span", { class: "bar-of", "aria-hidden": "true" });
  element.style.transform = `scaleX(${share})`;
  return element;
}

function* facts({ evidence, onset }) {
  if (evidence.reason) yield ["reason", evidence.reason];
  if (onset) yield ["onset", moment(millis(onset))];
  for (const [name, [word, unit, digits]] of Object.entries(SEVERITY)) {
    const value = evidence.severity?.[name];
    if (value) yield [word, `${signed(value.value, digits)} ${unit} (${signed(value.interval[0], digits)} to ${signed(value.interval[1], digits)})`];
  }
  if (evidence.shift_m) {
    const sigmas = evidence.shift_sigmas ?? {};
    yield ["pump curve", `${signed(evidence.shift_m.pump)} m, ${signed(sigmas.pump, 1)} σ`];
    yield ["system curve", `${signed(evidence.shift_m.system)} m, ${signed(sigmas.system, 1)} σ`];
    for (const name of ["drawdown", "power"]) if (name in sigmas) yield [name, `${signed(sigmas[name], 1)} σ`];
  }
  for (const [name, test] of Object.entries(evidence.f_test ?? {})) {
    yield [`F-test, ${name}`, `F ${figure(test.f, 2)}, p ${chance(test.log_p)}, ${test.samples} samples`];
  }
  const index = evidence.index ?? evidence.tangent;
  if (index) {
    const limits = index.limits ? `; limits ${figure(index.limits[0], 2)} and ${figure(index.limits[1], 2)}` : "";
    const says = index.says ? `; says ${index.says}` : "";
    yield ["I_W", `${figure(index.value, 2)} (${figure(index.interval[0], 2)} to ${figure(index.interval[1], 2)})${limits}${says}`];
  }
  if (evidence.cost) {
    const costs = Object.entries(evidence.cost.expected);
    yield ["cheapest", `${evidence.cost.cheapest}: ${figure(evidence.cost.expected[evidence.cost.cheapest], 0)}`];
    yield ["other costs", costs.filter(([name]) => name !== evidence.cost.cheapest).map(([name, cost]) => `${name} ${figure(cost, 0)}`).join(", ")];
  }
  for (const name of ["missing", "stuck", "dead", "lost", "noisy"]) if (evidence[name]?.length) yield [`${words(name)}`, evidence[name].join(", ")];
  if (evidence.signals) yield ["rests on", evidence.signals.join(", ")];
  if (evidence.steady_samples != null) yield ["steady samples", String(evidence.steady_samples)];
  if (evidence.baseline != null) yield ["baseline", `version ${evidence.baseline}`];
}

function chance(logP) {
  if (logP == null) return "–";
  const exponent = logP / Math.LN10;
  return exponent < -4 ? `1e${exponent.toFixed(0)}` : figure(Math.exp(logP), 4);
}
