// How far a fault has gone: in words, and as a bar beside its limits.

import { html, svg } from "../base/dom.js";
import { day, figure, millis, signed } from "../base/format.js";
import { kindOf } from "../base/states.js";
import { t } from "../base/words.js";

const OF_PUMP = t("At one duty point rags and wear look the same: only who opens the pump can tell.");
const OF_MAIN = t("At one flow friction and static head look the same: runs at other flows tell.");
export const QUANTITIES = {
  speed_loss_percent: { word: t("loss of speed"), unit: "%", digits: 1, doubt: OF_PUMP },
  friction_rise_percent: { word: t("more friction"), unit: "%", digits: 1, doubt: OF_MAIN },
  static_head_rise_m: { word: t("more static head"), unit: "m", digits: 2 },
  meter_error_percent: { word: t("error"), unit: "%", digits: 1 },
  wear_head_percent: { word: t("loss of head"), unit: "%", digits: 1, doubt: OF_PUMP },
};
const WIDTH = 420;
const LABEL = 100; // two words with a figure that are nearer than this would lie on each other

const formOf = (quantity) => QUANTITIES[quantity] ?? { word: t(String(quantity).replaceAll("_", " ")), unit: "", digits: 2 };

export function severityWords({ quantity, value, interval, limit }) {
  const { word, unit, digits } = formOf(quantity);
  const range = interval ? ` (${signed(interval[0], digits)} ${t("to")} ${signed(interval[1], digits)})` : "";
  const bound = limit == null ? "" : t(", limit {value} {unit}", { value: figure(limit, digits), unit });
  return `${word} ${figure(value, digits)} ${unit}${range}${bound}`;
}

/** Growth by the day; what its interval does not tell from none is none. */
function growthWords({ per_day: perDay, interval }, quantity) {
  const value = `${figure(Math.abs(perDay), 2)} ${formOf(quantity).unit}`.trim();
  if (interval[0] > 0) return t("it grows by {value} a day", { value });
  return interval[1] < 0 ? t("it shrinks by {value} a day", { value }) : t("no growth is seen");
}

/** How far a fault, or what an alarm tells of one, has gone, how it grows, and when it reaches the limit: a part of a sentence each. */
export function sizeWords({ severity, trend }) {
  const parts = severity ? [severityWords(severity)] : [];
  if (trend) parts.push(growthWords(trend, severity?.quantity));
  if (trend?.reaches_limit) parts.push(t("the limit is reached on {day}{interval}", { day: day(millis(trend.reaches_limit)), interval: trend.interval_at?.every(Boolean) ? ` (${day(millis(trend.interval_at[0]))} – ${day(millis(trend.interval_at[1]))})` : "" }));
  return parts;
}

/** A bar from nothing to beyond the limit, with the interval as a whisker; half of the limit is where a visit is planned. Below it stands what cannot be told apart. */
export function severityPicture(fault) {
  const { quantity, value, interval, limit } = fault.severity;
  const { word, unit, digits, doubt } = formOf(quantity);
  const most = 1.15 * Math.max(limit ?? 0, Math.abs(value), ...(interval ?? []).map(Math.abs), 1e-9);
  const x = (amount) => Math.max(0, (WIDTH * amount) / most);
  const isNarrow = limit != null && x(limit / 2) < LABEL;
  const anchor = (at) => (isNarrow ? "start" : at > most * 0.9 ? "end" : "middle");
  const lines = limit == null ? [] : [[limit / 2, isNarrow ? "" : `${t("plan")} ${figure(limit / 2, digits)}`], [limit, `${t("limit")} ${figure(limit, digits)}`]];
  const drawing = svg("svg", { class: `severity is-${kindOf(fault)}`, viewBox: `0 -16 ${WIDTH} 62`, role: "img", "aria-label": severityWords(fault.severity) },
    svg("rect", { class: "track", x: 0, y: 4, width: WIDTH, height: 16 }),
    svg("rect", { class: "bar", x: 0, y: 4, width: x(value).toFixed(1), height: 16 }),
    interval ? svg("path", { class: "whisker", d: `M${x(interval[0])} 12H${x(interval[1])}M${x(interval[0])} 7v10M${x(interval[1])} 7v10` }) : null,
    ...lines.flatMap(([at, name]) => [svg("line", { class: "bound", x1: x(at), x2: x(at), y1: 0, y2: 24 }), svg("text", { x: x(at), y: -4, "text-anchor": anchor(at) }, name)]),
    svg("text", { x: 0, y: 40 }, `${word}: ${figure(value, digits)} ${unit}`));
  return html("div", {}, drawing, doubt ? html("p", { class: "note" }, doubt) : null);
}
