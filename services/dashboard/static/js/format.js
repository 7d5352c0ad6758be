// Numbers and times as they are shown. Times are UTC, as everywhere in wetwell.

export const NONE = "–";

export const figure = (value, digits = 1) => (Number.isFinite(value) ? value.toFixed(digits) : NONE);

export const signed = (value, digits = 2) =>
  Number.isFinite(value) ? (Math.abs(value) < 0.5 * 10 ** -digits ? "" : value > 0 ? "+" : "−") + Math.abs(value).toFixed(digits) : NONE;

export const percent = (share) => (Number.isFinite(share) ? `${(100 * share).toFixed(share > 0.9995 || share < 0.0005 ? 2 : 1)} %` : NONE);

export const moment = (ms) => (Number.isFinite(ms) ? new Date(ms).toISOString().slice(0, 19).replace("T", " ") : NONE);

export const clock = (ms) => moment(ms).slice(11);

export const millis = (stamp) => (stamp ? Date.parse(stamp) : NaN);

export const words = (name) => name.replaceAll("_", " ");

/** A health figure in words: `live_bytes` in MB, `commit_age_s` in s, min, h or days, `is_failing` as yes or no. */
export function measure(name, value) {
  if (name.startsWith("is_")) return `${words(name)} ${value ? "yes" : "no"}`;
  if (name.endsWith("_bytes")) return `${words(name.slice(0, -6))} ${short(value / 1e6)} MB`;
  if (!name.endsWith("_s")) return `${words(name)} ${Number.isInteger(value) ? value : short(value)}`;
  const [size, unit] = [[86_400, "days"], [3600, "h"], [60, "min"], [1, "s"]].find(([each]) => Math.abs(value) >= 2 * each) ?? [1, "s"];
  return `${words(name.slice(0, -2))} ${short(value / size)} ${unit}`;
}

const short = (value) => Number(value.toPrecision(3));

export function ago(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 90) return `${Math.round(seconds)} s ago`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min ago`;
  return `${Math.round(seconds / 3600)} h ago`;
}
