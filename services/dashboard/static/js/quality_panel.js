// Data quality: which values are missing, and how the services of this station fare.

import { html, panel, say } from "./dom.js";
import { figure, words } from "./format.js";

const NAMES = ["frequency", "flow", "head", "power"];
const TOLD = { missing_values: "missing values", out_of_range_values: "impossible values", bad_quality: "bad samples", late: "late", doubled: "doubled", gaps: "gaps", lost: "lost", clock_steps: "clock set", malformed: "malformed", foreign: "foreign", dropped: "dropped", failures: "failures" };

export function qualityPanel(station) {
  const source = html("p");
  const missing = html("p", { class: "note" });
  const services = html("tbody");
  const element = panel("Data quality and services", source, missing,
    html("div", { class: "scroll" }, html("table", {}, html("thead", {}, html("tr", {}, ...["Service", "Is there", "Counts"].map((word) => html("th", { scope: "col" }, word)))), services)));
  element.classList.add("is-quality");

  function lacking() {
    const share = (pick) => station.rows.filter((row) => !Number.isFinite(pick(row))).length / station.rows.length;
    const shares = [["level", share((row) => row[1])]];
    for (let number = 1; number <= station.pumps; number += 1) {
      for (const name of NAMES) shares.push([`pump ${station.called(number)} ${name}`, share((row) => station.pump(number, row)[name])]);
    }
    return shares.filter(([, value]) => value > 0).map(([name, value]) => `${name} ${figure(100 * value, 1)} %`);
  }

  function update(changed) {
    say(source, station.stale ? "No samples come." : `Samples come; quality ${station.quality}; ${station.lost} lost on the way to this page.`);
    if (changed.has("rows") && station.rows.length) {
      const found = lacking();
      say(missing, `Of the last ${station.rows.length} samples drawn ${found.length ? `lack: ${found.join(", ")}` : "no value is missing"}.`);
    }
    if (!changed.has("services")) return;
    const names = [...new Set([...station.alive, ...station.statuses.keys()])].sort();
    services.replaceChildren(...names.map((name) => {
      const figures = station.statuses.get(name)?.figures ?? {};
      const counts = Object.entries(figures).filter(([key, value]) => key in TOLD && value > 0).map(([key, value]) => `${TOLD[key]} ${value}`);
      const isThere = station.alive.includes(name);
      return html("tr", {}, html("th", { scope: "row" }, words(name)), html("td", { class: isThere ? "" : "is-gone" }, isThere ? "yes" : "gone"), html("td", {}, counts.join(", ") || "nothing wrong"));
    }));
  }

  return { element, update };
}
