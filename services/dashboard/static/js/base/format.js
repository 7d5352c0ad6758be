// Numbers and times as they are shown: in the reader's language, and in local time or UTC as the reader has chosen.

import { language, t } from "./words.js";

export const NONE = "–";
export const ZONE = localStorage.getItem("zone") === "utc" ? "UTC" : undefined;

const numbers = [0, 1, 2, 3, 4].map((digits) => new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: false }));
const parts = new Intl.DateTimeFormat("sv", { timeZone: ZONE, year: "numeric", month: "2-digit", day: "2-digit", hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
const zoneName = new Intl.DateTimeFormat(language, { timeZone: ZONE, timeZoneName: "short" });

export const figure = (value, digits = 1) => (Number.isFinite(value) ? numbers[digits].format(value) : NONE);

export const signed = (value, digits = 2) =>
  Number.isFinite(value) ? (Math.abs(value) < 0.5 * 10 ** -digits ? "" : value > 0 ? "+" : "−") + figure(Math.abs(value), digits) : NONE;

export const percent = (share) => (Number.isFinite(share) ? `${figure(100 * share, share > 0.9995 || share < 0.0005 ? 2 : 1)} %` : NONE);

/** "2025-01-01 08:18:02": sorts as it reads, in every language. */
export const moment = (ms) => (Number.isFinite(ms) ? parts.format(ms) : NONE);

export const day = (ms) => moment(ms).slice(0, 10);

export const clock = (ms) => moment(ms).slice(11);

/** Name of the zone that times are in, at that time: "UTC", "CET", "GMT+2". */
export const zone = (ms) => zoneName.formatToParts(Number.isFinite(ms) ? ms : Date.now()).find((part) => part.type === "timeZoneName").value;

export const millis = (stamp) => (stamp ? Date.parse(stamp) : NaN);

export const words = (name) => t(name.replaceAll("_", " "));

/** A health figure in words: `live_bytes` in MB, `commit_age_s` in s, min, h or days, `is_failing` as yes or no. */
export function measure(name, value) {
  if (name.startsWith("is_")) return `${words(name)} ${value ? t("yes") : t("no")}`;
  if (name.endsWith("_bytes")) return `${words(name.slice(0, -6))} ${short(value / 1e6)} MB`;
  if (!name.endsWith("_s")) return `${words(name)} ${Number.isInteger(value) ? value : short(value)}`;
  return `${words(name.slice(0, -2))} ${lasting(value)}`;
}

const short = (value) => Number(value.toPrecision(3));

/** A time span in the unit that reads best. */
export function lasting(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  const [size, unit] = [[86_400, t("days")], [3600, "h"], [60, "min"], [1, "s"]].find(([each]) => Math.abs(seconds) >= 2 * each) ?? [1, "s"];
  return `${short(seconds / size)} ${unit}`;
}

export const ago = (seconds) => (Number.isFinite(seconds) ? t("{span} ago", { span: lasting(Math.round(seconds)) }) : NONE);

export function startZone() {
  const select = document.getElementById("zone");
  select.value = ZONE === "UTC" ? "utc" : "local";
  select.addEventListener("change", () => {
    localStorage.setItem("zone", select.value);
    location.reload();
  });
}
