// What the detector has said of each pump over time; on click what it rests on.

import { html, mark, panel, say, svg } from "./dom.js";
import { evidenceOf } from "./evidence.js";
import { clock, millis, moment } from "./format.js";
import { STATES, chip, icon, state } from "./states.js";

const LANE = 30;
const LEFT = 78;

export function verdictPanel(station, chosen, choose) {
  const drawing = svg("svg", { class: "lanes", role: "img", "aria-label": "State of each pump over time; the list of changes tells the same" });
  const back = html("button", { type: "button", "aria-label": "Verdict before", onclick: () => step(-1) }, "‹");
  const on = html("button", { type: "button", "aria-label": "Verdict after", onclick: () => step(1) }, "›");
  const last = html("button", { type: "button", onclick: () => select(null) }, "latest");
  const changes = html("ol", { class: "changes", "aria-label": "Changes of state, newest first" });
  const evidence = html("div", { class: "evidence" });
  const element = panel("Verdicts", drawing, html("div", { class: "split" }, html("div", {}, html("h3", {}, "Changes of state"), changes), evidence));
  element.querySelector("header").append(html("div", { class: "buttons" }, back, on, last));
  element.classList.add("is-verdicts");
  let selected = null; // time of the verdict that is shown; null is the latest

  const told = () => station.verdicts.get(chosen()) ?? [];

  function place() {
    const all = told();
    const found = all.findIndex((verdict) => verdict.time === selected);
    return found < 0 ? all.length - 1 : found;
  }

  function select(time) {
    selected = time;
    update(new Set(["verdicts"]));
  }

  function step(by) {
    const all = told();
    const wanted = Math.min(all.length - 1, Math.max(0, place() + by));
    if (all[wanted]) select(all[wanted].time);
  }

  function draw() {
    const all = [...station.verdicts.values()].flat();
    const from = Math.min(...all.map((verdict) => millis(verdict.time)));
    const to = Math.max(...all.map((verdict) => millis(verdict.time)), from + 1000);
    const width = drawing.clientWidth || 760;
    const x = (ms) => LEFT + ((width - LEFT - 8) * (ms - from)) / (to - from);
    const height = LANE * station.pumps + 18;
    mark(drawing, "viewBox", `0 0 ${width} ${height}`);
    const lanes = Array.from({ length: station.pumps }, (_, index) => lane(index + 1, x, to));
    drawing.replaceChildren(...lanes,
      svg("text", { x: LEFT, y: height - 4 }, moment(from)), svg("text", { x: width - 8, y: height - 4, "text-anchor": "end" }, clock(to)));
  }

  function lane(number, x, to) {
    const verdicts = station.verdicts.get(number) ?? [];
    const y = LANE * (number - 1) + 4;
    const blocks = verdicts.map((verdict, index) => {
      const start = x(millis(verdict.time));
      const end = index + 1 < verdicts.length ? x(millis(verdicts[index + 1].time)) : x(to);
      const shownNow = number === chosen() && index === place();
      return svg("rect", {
        class: `block is-${state(verdict.state).kind} ${verdict.state}${shownNow ? " chosen" : ""}`,
        x: start, y, width: Math.max(2, end - start), height: LANE - 9,
        onclick: () => {
          selected = verdict.time;
          if (number === chosen()) update(new Set(["verdicts"]));
          else choose(number);
        },
      }, svg("title", {}, `${moment(millis(verdict.time))}: ${STATES[verdict.state].word}`));
    });
    const name = station.pumpState(number);
    const badge = svg("g", { class: `is-${state(name).kind}`, transform: `translate(0 ${y + 3})` }, icon(name, 14));
    return svg("g", {}, svg("title", {}, `Pump ${station.called(number)}`), badge, svg("text", { x: 20, y: y + 14 }, station.nameOf(number) ?? `Pump ${number}`), ...blocks);
  }

  function listChanges() {
    const all = told().filter((verdict, index, every) => index === 0 || every[index - 1].state !== verdict.state);
    changes.replaceChildren(...all.slice(-12).reverse().map((verdict) =>
      html("li", {}, html("button", { type: "button", "aria-pressed": verdict.time === told()[place()]?.time, onclick: () => select(verdict.time) },
        chip(verdict.state), html("span", { class: "note" }, moment(millis(verdict.time)))))));
    if (!all.length) changes.replaceChildren(html("li", { class: "empty" }, "No verdict yet."));
  }

  function update(changed) {
    if (changed.has("pump")) selected = told().some((verdict) => verdict.time === selected) ? selected : null;
    if (!changed.has("verdicts") && !changed.has("model")) return;
    draw();
    const held = changes.contains(document.activeElement) ? [...changes.querySelectorAll("button")].indexOf(document.activeElement) : -1;
    listChanges();
    if (held >= 0) changes.querySelectorAll("button")[held]?.focus();
    const shown = told()[place()];
    evidence.replaceChildren(...(shown ? evidenceOf(shown) : [html("p", { class: "empty" }, "No verdict yet.")]));
    back.disabled = place() <= 0;
    on.disabled = place() >= told().length - 1;
    mark(last, "aria-pressed", selected === null);
    say(element.querySelector("h2"), `Verdicts, pump ${station.called(chosen())}`);
  }

  return { element, update };
}
