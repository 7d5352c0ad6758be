// What a line of the overview says of a fault, and which stations come first.

import { day, figure } from "../base/format.js";
import { STAGES, assetWords, kindOf, state } from "../base/states.js";
import { t } from "../base/words.js";
import { QUANTITIES } from "../station/severity.js";

/** What a station asks of people, as one number: act before a station that nobody sees, before what can be planned. */
export function need(station) {
  const { cause } = station;
  const stage = STAGES[cause?.stage]?.rank;
  if (stage === 3 || (cause && !stage && state(cause.state).rank >= 6)) return 6;
  if (station.state === "no_data" || (station.quality && station.quality !== "good")) return 5;
  if (stage === 2 || (cause && !stage)) return 4;
  if (station.unacknowledged) return 3;
  if (stage === 1) return 2;
  return state(station.state).rank >= 3 ? 1 : 0;
}

/** First what asks for most; then what waiting costs; then what began first. */
export const byNeed = (a, b) =>
  need(b) - need(a) || (b.cause?.waiting_cost ?? -1) - (a.cause?.waiting_cost ?? -1) || (a.cause?.since_ms ?? Infinity) - (b.cause?.since_ms ?? Infinity) || 0;

const called = (station) => (number) => (station.names?.[number - 1] ? `${number} (${station.names[number - 1]})` : String(number));

export function causeWords(station) {
  const { cause } = station;
  return cause ? assetWords(cause.asset, called(station)) : "";
}

export const stageWord = (station) => (station.cause ? (STAGES[station.cause.stage]?.word ?? "") : "");

export const sinceWords = (station) => (station.cause ? day(station.cause.since_ms) : "");

export function severityShort({ cause }) {
  if (!cause?.severity) return "";
  const { unit = "", digits = 1 } = QUANTITIES[cause.severity.quantity] ?? {};
  const limit = cause.severity.limit == null ? "" : ` / ${figure(cause.severity.limit, digits)}`;
  return `${figure(cause.severity.value, digits)}${limit} ${unit}`;
}

/** An arrow and the growth in a day; what its interval does not tell from none is none. */
export function trendWords({ cause }) {
  const grows = cause?.trend?.per_day;
  if (!Number.isFinite(grows)) return "";
  const unit = QUANTITIES[cause.severity?.quantity]?.unit ?? "";
  const [least, most] = cause.trend.interval;
  if (least <= 0 && most >= 0) return "→";
  return `${grows > 0 ? "↗" : "↘"} ${figure(grows, 2)} ${unit}${t("/day")}`;
}

export const costWords = ({ cause }) => (cause?.waiting_cost == null ? "" : figure(cause.waiting_cost, 0));

/** Colour of a station's line: that of its cause, unless nobody sees it. */
export const kindOfStation = (station) => (station.state !== "no_data" && station.cause ? kindOf(station.cause) : state(station.state).kind);
