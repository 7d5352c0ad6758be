// Data quality: which values are missing, and how the services of this station fare.

import { serviceWord } from "../base/absent.js";
import { html, panel, say } from "../base/dom.js";
import { figure } from "../base/format.js";
import { grade } from "../base/quality.js";
import { t } from "../base/words.js";

const NAMES = { frequency: t("frequency"), flow: t("flow"), head: t("head"), power: t("power") };
const TOLD = { missing_values: t("missing values"), out_of_range_values: t("impossible values"), bad_quality: t("bad samples"), late: t("late"), doubled: t("doubled"), gaps: t("gaps"), lost: t("lost"), clock_steps: t("clock set"), malformed: t("malformed"), foreign: t("foreign"), dropped: t("dropped"), failures: t("failures") };

/** Services without which something on this page is missing. */
const EXPECTED = ["detector", "historian", "alarms"];

export function qualityPanel({ station }) {
  const source = html("p");
  const missing = html("p", { class: "note" });
  const services = html("tbody");
  const element = panel(t("Data quality and services"), source, missing,
    html("div", { class: "scroll" }, html("table", {}, html("thead", {}, html("tr", {}, ...[t("Service"), t("Is there"), t("Counts")].map((word) => html("th", { scope: "col" }, word)))), services)));
  element.classList.add("is-quality");

  function lacking() {
    const share = (pick) => station.rows.filter((row) => !Number.isFinite(pick(row))).length / station.rows.length;
    const shares = [[t("level"), share((row) => row[1])]];
    for (let number = 1; number <= station.pumps; number += 1) {
      for (const [name, word] of Object.entries(NAMES)) shares.push([t("{quantity} of pump {name}", { quantity: word, name: station.called(number) }), share((row) => station.pump(number, row)[name])]);
    }
    return shares.filter(([, value]) => value > 0).map(([name, value]) => `${name} ${figure(100 * value, 1)} %`);
  }

  function update(changed) {
    const { kind, reason } = station.currency;
    say(source, kind === "good" ? t("Samples come, and are good; {lost} lost on the way to this page.", { lost: station.lost }) : t("Samples: {reason}.", { reason }));
    grade(source, kind, reason);
    if (changed.has("rows") && station.rows.length) {
      const found = lacking();
      say(missing, found.length ? t("Missing in the last {count} samples: {what}.", { count: station.rows.length, what: found.join(", ") }) : t("No value is missing in the last {count} samples.", { count: station.rows.length }));
    }
    if (!changed.has("services")) return;
    const names = [...new Set([...EXPECTED, ...station.alive, ...station.site, ...station.statuses.keys()])].sort();
    services.replaceChildren(...names.map((name) => {
      const figures = station.statuses.get(name)?.figures ?? {};
      const counts = Object.entries(figures).filter(([key, value]) => key in TOLD && value > 0).map(([key, value]) => `${TOLD[key]} ${value}`);
      const isThere = station.has(name);
      return html("tr", {}, html("th", { scope: "row" }, serviceWord(name)), html("td", { class: isThere ? "" : "is-gone" }, isThere ? t("yes") : t("gone")), html("td", {}, counts.join(", ") || (isThere ? t("nothing wrong") : "")));
    }));
  }

  return { element, update };
}
