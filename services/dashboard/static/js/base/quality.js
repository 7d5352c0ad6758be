// How good a value is, the same for every number and drawing: good, old with its age, bad, or never seen.
// Only what is good is drawn in full ink. All else is grey and hatched.

import { lasting } from "./format.js";
import { t } from "./words.js";

/** What the page knows about how current all values of a station are. */
export class Currency {
  constructor() {
    this.clear();
  }

  clear() {
    this.quality = null;
    this.stale = true;
    this.age_s = null;
    this.heard = performance.now();
    this.isLinked = true;
  }

  take({ quality, stale, age_s: age }) {
    Object.assign(this, { quality, stale, age_s: age, heard: performance.now() });
  }

  /** Seconds since the last sample came; null where nobody knows. */
  get age() {
    return this.age_s == null ? null : this.age_s + (performance.now() - this.heard) / 1000;
  }

  get kind() {
    if (this.quality === null) return "never";
    if (this.stale || !this.isLinked) return "old";
    return this.quality === "good" ? "good" : "bad";
  }

  get reason() {
    const age = this.age == null ? t("age unknown") : lasting(Math.round(this.age));
    return {
      good: "",
      never: t("never seen"),
      old: this.isLinked ? t("old, {age}", { age }) : t("old, {age}, no connection to the server", { age }),
      bad: t("bad: its source says {quality}", { quality: t(this.quality ?? "") }),
    }[this.kind];
  }
}

/** A value of the last row: how good it is, and where it is missing the last one that was there. */
export function reading(station, pick) {
  const rows = station.shownRows;
  const last = rows.length - 1;
  if (last >= 0 && Number.isFinite(pick(rows[last]))) return { value: pick(rows[last]), kind: station.shownKind, reason: station.shownReason };
  for (let place = last - 1; place >= 0; place -= 1) {
    const value = pick(rows[place]);
    if (!Number.isFinite(value)) continue;
    const age = lasting(Math.round((rows[last][0] - rows[place][0]) / 1000));
    return { value, kind: "old", reason: t("old, {age}", { age }) };
  }
  return { value: null, kind: "never", reason: t("never seen") };
}

/** Marks an element with how good what it shows is; styles do the rest. */
export function grade(node, kind, reason = "") {
  if (node.dataset.quality !== kind) node.dataset.quality = kind;
  if (node instanceof HTMLElement && node.title !== reason) node.title = reason;
}

/** The worst of some kinds. */
export const worst = (kinds) => ["never", "bad", "old", "good"].find((kind) => kinds.includes(kind)) ?? "never";
