// The wet well and its pumps, drawn and moving.

import { html, mark, panel, say, svg } from "./dom.js";
import { figure } from "./format.js";
import { icon, isFault, state } from "./states.js";

const WIDTH = 560;
const HEIGHT = 400;
const PIPE = { y: 34, apart: 12 };
const WELL = { left: 84, right: 534, top: 120, bottom: 330 };

export function wellPanel(station, chosen, choose) {
  const drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "well", role: "img", "aria-labelledby": "well-words" });
  const words = html("p", { id: "well-words", class: "unseen" });
  const element = panel("Wet well and pumps", drawing, words);
  element.classList.add("is-well");
  let pumps = [];
  let made = "";
  let water;
  let levelText;
  let inflowText;
  let mainText;

  function make() {
    const { left, right, top, bottom } = WELL;
    const width = right - left;
    water = svg("rect", { class: "water", x: left, y: top, width, height: bottom - top });
    levelText = svg("text", { class: "big", x: left - 7, "text-anchor": "end" });
    inflowText = svg("text", { x: 4, y: top - 42 });
    mainText = svg("text", { x: right, y: 22, "text-anchor": "end" });
    pumps = Array.from({ length: station.pumps }, (_, place) => pumpDrawing(place + 1, left + (width * (place + 0.5)) / station.pumps, pipeY(station.mainOf(place + 1)), choose));
    const lines = levels().map(({ value, word }) => {
      const y = levelY(value);
      return svg("g", { class: "limit" }, svg("line", { x1: right - 14, x2: right, y1: y, y2: y }), svg("text", { x: right + 5, y: y + 3.5 }, word));
    });
    drawing.replaceChildren(
      ...station.mains.flatMap((_, place) => [
        svg("line", { class: "pipe", x1: left, x2: right, y1: pipeY(place), y2: pipeY(place) }),
        svg("path", { class: "arrow", d: `M${right} ${pipeY(place)}l-12 -7v14z` }),
      ]),
      svg("path", { class: "pipe", d: `M4 ${top - 30}H${left - 22}V${top - 8}` }),
      svg("path", { class: "arrow", d: `M${left - 22} ${top + 4}l-7 -13h14z` }),
      water, svg("path", { class: "wall", d: `M${left} ${top - 8}V${bottom}H${right}V${top - 8}` }),
      ...lines, ...pumps.map((each) => each.element), levelText, inflowText, mainText,
    );
  }

  const starts = () => station.model?.start_levels_m ?? [];
  const floor = () => station.model?.floor_level_m ?? 0;
  const known = () => (starts().length ? starts() : station.rows.map((row) => row[1] ?? floor()));
  const depth = () => Math.max(2, ...known().map((level) => level - floor())) * 1.2;
  const levelY = (level) => WELL.bottom - ((WELL.bottom - WELL.top) * (level - floor())) / depth();

  function levels() {
    const stops = station.model?.stop_levels_m ?? [];
    return [
      ...starts().map((value, place) => ({ value, word: `S${place + 1}` })),
      ...stops.map((value, place) => ({ value, word: `E${place + 1}` })),
    ];
  }

  function update() {
    const form = `${station.pumps} ${starts()} ${floor()} ${station.mains}`;
    if (form !== made) {
      made = form;
      make();
    }
    const level = station.level;
    const share = Number.isFinite(level) ? Math.min(1, Math.max(0, (level - floor()) / depth())) : 0;
    water.style.transform = `scaleY(${share})`;
    say(levelText, `${figure(level, 2)} m`);
    mark(levelText, "y", (levelY(floor() + share * depth()) + 6).toFixed(0));
    say(inflowText, station.inflow == null ? "inflow" : `inflow ${figure(station.inflow, 0)} m³/h`);
    say(mainText, station.mains.map((name, place) => `${name ?? "rising main"} ${figure(station.totalFlow(pumpsOf(place)), 0)} m³/h`).join(", "));
    for (const each of pumps) each.update(station, chosen());
    const told = pumps.map((_, place) => `pump ${station.called(place + 1)} ${station.isRunning(place + 1) ? "runs" : "stands"}, ${state(station.pumpState(place + 1)).word}`);
    say(words, `Level ${figure(level, 2)} m. ${told.join("; ")}.`);
  }

  const pumpsOf = (main) => pumps.map((_, place) => place + 1).filter((number) => station.mainOf(number) === main);

  return { element, update };
}

/** Pipes of several mains lie one under the other; the first where a single one is. */
const pipeY = (main) => PIPE.y + PIPE.apart * main;

function pumpDrawing(number, x, top, choose) {
  const y = 292;
  const impeller = svg("g", { class: "impeller" },
    ...[0, 120, 240].map((turn) => svg("path", { d: "M0 0C2-8 8-12 15-11", transform: `rotate(${turn})` })));
  const body = svg("g", { transform: `translate(${x} ${y})` }, svg("circle", { r: 22 }), impeller);
  const pipe = svg("path", { class: "pipe", d: `M${x} ${y - 22}V${top}` });
  const badge = svg("g", { class: "badge", transform: `translate(${x + 14} ${y - 36})` });
  const flow = svg("text", { x: x + 7, y: 66 });
  const head = svg("text", { x: x + 7, y: 82 });
  const hint = svg("title", {}, `Pump ${number}`);
  const title = svg("text", { class: "name", x, y: 350, "text-anchor": "middle" }, `Pump ${number}`);
  const doing = svg("text", { x, y: 367, "text-anchor": "middle" });
  const condition = svg("text", { class: "condition", x, y: 384, "text-anchor": "middle" });
  const element = svg("g", { class: "pump", onclick: () => choose(number) }, hint, pipe, body, badge, flow, head, title, doing, condition);
  let shown = "";

  function update(station, chosen) {
    const { frequency, flow: flowM3h, head: headM, power } = station.pump(number);
    const runs = station.isRunning(number);
    const name = station.pumpState(number);
    mark(element, "class", `pump is-${state(name).kind}${runs ? " runs" : ""}${chosen === number ? " chosen" : ""}`);
    mark(element, "data-state", name);
    say(title, station.nameOf(number) ?? `Pump ${number}`);
    say(hint, `Pump ${station.called(number)}`);
    impeller.style.animationDuration = runs && frequency > 1 ? `${(45 / frequency).toFixed(1)}s` : "";
    say(flow, runs ? `${figure(flowM3h, 0)} m³/h` : "");
    say(head, runs ? `${figure(headM, 1)} m` : "");
    say(doing, runs ? `${figure(frequency, 0)} Hz, ${figure(power, 1)} kW` : "stands");
    say(condition, state(name).word);
    if (shown !== name) {
      shown = name;
      badge.replaceChildren(...(isFault(name) ? [icon(name, 20)] : []));
    }
  }
  return { element, update };
}
