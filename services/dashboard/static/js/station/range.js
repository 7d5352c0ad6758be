// The one time range of the station page: live, a span until now, or between two dates; and the moment that is looked at.

import { query, remember } from "../base/address.js";
import { html, mark } from "../base/dom.js";
import { ZONE, moment } from "../base/format.js";
import { t } from "../base/words.js";

export const HOUR_MS = 3_600_000;
const SPANS = { "1h": 1, "6h": 6, "24h": 24, "7d": 168, "30d": 720, "90d": 2160 };
const LEAST_MS = 10_000;
const MOST_MS = 400 * 24 * HOUR_MS;

/** `endOf()` is the time at which a span ends: that of the last sample. */
export function timeRange(endOf, changed) {
  let wanted = parse();
  let at = Date.parse(query("at")) || null;

  function parse() {
    const [from, to] = [Date.parse(query("from")), Date.parse(query("to"))];
    if (from < to) return { from, to };
    const name = query("span");
    return name in SPANS ? { name } : { name: "live" };
  }

  function limits() {
    if (wanted.from) return [wanted.from, wanted.to];
    const end = endOf() ?? Date.now();
    return [end - (SPANS[wanted.name] ?? 1) * HOUR_MS, end];
  }

  const iso = (ms) => new Date(ms).toISOString();

  function look(next) {
    wanted = next;
    at = null;
    remember(next.from
      ? { span: "", from: iso(next.from), to: iso(next.to), at: "" }
      : { span: next.name === "live" ? "" : next.name, from: "", to: "", at: "" }, { isStep: true });
    show();
    changed();
  }

  function between(from, to) {
    const middle = (from + to) / 2;
    const half = Math.min(MOST_MS, Math.max(LEAST_MS, to - from)) / 2;
    const [begin, end] = [Math.round(middle - half), Math.round(middle + half)];
    if (wanted.from !== begin || wanted.to !== end) look({ from: begin, to: end }); // each chart of a stack tells of the same drag
  }

  /** Looks at a moment of the range; null for its end. */
  function pick(moment_) {
    at = moment_ == null ? null : Math.round(moment_);
    remember({ at: at == null ? "" : iso(at) });
    changed();
  }

  function move(share) {
    const [from, to] = limits();
    between(from + share * (to - from), to + share * (to - from));
  }

  function widen() {
    const [from, to] = limits();
    between(from - (to - from) / 2, to + (to - from) / 2);
  }

  const step = (word, sign, act) => html("button", { type: "button", "aria-label": word, title: word, onclick: act }, sign);
  const buttons = ["live", ...Object.keys(SPANS)].map((name) =>
    html("button", { type: "button", "data-span": name, onclick: () => look({ name }) }, name === "live" ? t("live") : name.replace(/(\d+)d/, `$1 ${t("d")}`).replace(/(\d+)h/, "$1 h")));
  const field = (word) => html("input", { type: "datetime-local", "aria-label": word, title: word, step: 1 });
  const [first, last] = [field(t("from")), field(t("to"))];
  const dates = html("form", { class: "buttons" }, first, last, html("button", { type: "submit" }, t("show")));
  const parsed = (input) => Date.parse(ZONE === "UTC" ? `${input.value}Z` : input.value);
  dates.addEventListener("submit", (event) => {
    event.preventDefault();
    const [from, to] = [parsed(first), parsed(last)];
    last.setCustomValidity(from < to ? "" : t("must lie after the beginning"));
    if (last.reportValidity() && from < to) between(from, to);
  });
  last.addEventListener("input", () => last.setCustomValidity(""));
  const element = html("div", { class: "range", role: "group", "aria-label": t("Time range") },
    html("div", { class: "buttons" }, ...buttons),
    html("div", { class: "buttons" },
      step(t("Earlier"), "‹", () => move(-0.5)), step(t("Later"), "›", () => move(0.5)),
      step(t("Wider"), "−", widen), step(t("Back"), "↶", () => history.back())),
    dates);

  function show() {
    for (const button of buttons) mark(button, "aria-pressed", button.dataset.span === wanted.name);
    if (dates.contains(document.activeElement)) return;
    const [from, to] = limits();
    for (const [input, ms] of [[first, from], [last, to]]) {
      const value = moment(ms).replace(" ", "T");
      if (input.value !== value) input.value = value;
    }
  }

  return {
    element, limits, between, pick, show,
    get isLive() {
      return wanted.name === "live";
    },
    get isOpen() {
      return !wanted.from;
    },
    get at() {
      return at;
    },
    /** The moment that is looked at: as picked, else the end of the range. */
    get moment() {
      return at ?? limits()[1];
    },
    /** Takes the range from the address: somebody went back. */
    read() {
      wanted = parse();
      at = Date.parse(query("at")) || null;
      show();
      changed();
    },
  };
}
