// The pumps of a station in a line: filled while they run, in the colour of their state, with a word for each.

import { html, mark, svg } from "./dom.js";
import { state } from "./states.js";

export function pumpIcons() {
  const element = html("span", { class: "pumps", role: "img" });

  function show(states, running, names = []) {
    while (element.children.length < states.length) {
      element.append(svg("svg", { viewBox: "0 0 18 18", width: 18, height: 18, "aria-hidden": "true" },
        svg("circle", { cx: 9, cy: 9, r: 7, "stroke-width": 2, stroke: "currentColor" }), svg("path", { d: "M9 9V2", "stroke-width": 2, stroke: "currentColor" })));
    }
    while (element.children.length > states.length) element.lastChild.remove();
    states.forEach((name, place) => {
      const pump = element.children[place];
      mark(pump, "class", `is-${state(name).kind}`);
      mark(pump.firstChild, "fill", running.includes(place + 1) ? "currentColor" : "none");
    });
    const words = states.map((name, place) => `pump ${place + 1}${names[place] ? ` (${names[place]})` : ""} ${running.includes(place + 1) ? "runs" : "stands"}, ${state(name).word}`);
    mark(element, "aria-label", words.join("; ") || "no pumps");
  }
  return { element, show };
}
