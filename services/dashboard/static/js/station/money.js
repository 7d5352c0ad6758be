// What each act is expected to cost, waiting among them.

import { adviceWords } from "../base/advice.js";
import { html } from "../base/dom.js";
import { figure } from "../base/format.js";
import { t } from "../base/words.js";

export function moneyOf({ evidence }, fault) {
  const parts = [];
  const advice = fault?.advice || evidence?.advice;
  if (advice) parts.push(html("p", { class: "advice" }, adviceWords(advice)));
  const cost = evidence?.cost;
  if (!cost) return parts;
  const entries = Object.entries(cost.expected);
  const most = Math.max(...entries.map(([, value]) => value), 1e-9);
  const rows = entries.map(([act, value]) => html("tr", { class: act === cost.cheapest ? "strong" : "" },
    html("th", { scope: "row" }, t(act)), html("td", { class: "share" }, bar(value / most)), html("td", { class: "number" }, figure(value, 0))));
  parts.push(html("table", { class: "posterior money" }, html("caption", {}, t("Expected cost; cheapest: {act}", { act: t(cost.cheapest) })), html("tbody", {}, ...rows)));
  return parts;
}

export function bar(share) {
  const element = html("span", { class: "bar-of", "aria-hidden": "true" });
  element.style.transform = `scaleX(${share})`;
  return element;
}
