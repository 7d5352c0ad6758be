// The pumps of a station in a line: filled while they run, in the colour of their state, with a word for each. A fault of their main is none of theirs.

import { html, mark, svg } from "../base/dom.js";
import { state } from "../base/states.js";
import { t } from "../base/words.js";

const own = (name) => (name === "system_fault" ? { kind: "calm", word: t("see main") } : state(name === "pump_and_system_fault" ? "pump_fault" : name));

export function pumpIcons() {
  const element = html("span", { class: "pumps", role: "img" });

  /** `isGood`: whether it is known what they do now. */
  function show(states, running, names = [], isGood = true) {
    while (element.children.length < states.length) {
      element.append(svg("svg", { viewBox: "0 0 18 18", width: 18, height: 18, "aria-hidden": "true" },
        svg("circle", { cx: 9, cy: 9, r: 7, "stroke-width": 2, stroke: "currentColor" }), svg("path", { d: "M9 9V2", "stroke-width": 2, stroke: "currentColor" })));
    }
    while (element.children.length > states.length) element.lastChild.remove();
    states.forEach((name, place) => {
      const pump = element.children[place];
      mark(pump, "class", isGood ? `is-${own(name).kind}` : "is-calm not-good");
      mark(pump.firstChild, "fill", running.includes(place + 1) ? "currentColor" : "none");
    });
    const words = states.map((name, place) => t("pump {name} {does}, {state}", { name: `${place + 1}${names[place] ? ` (${names[place]})` : ""}`, does: running.includes(place + 1) ? t("runs") : t("stands"), state: own(name).word }));
    mark(element, "aria-label", words.join("; ") || t("no pumps"));
  }
  return { element, show };
}
