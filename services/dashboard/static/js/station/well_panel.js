// The wet well and its pumps, drawn and moving.

import { absence } from "../base/absent.js";
import { html, mark, panel, say, svg } from "../base/dom.js";
import { NONE, figure, moment } from "../base/format.js";
import { grade, reading, worst } from "../base/quality.js";
import { icon, isOfMain, kindOf, stageOf, state } from "../base/states.js";
import { t } from "../base/words.js";

const WIDTH = 560;
const HEIGHT = 400;
const PIPE = { y: 34, apart: 12 };
const WELL = { left: 84, right: 534, top: 120, bottom: 330 };

export function wellPanel({ station, past, chosen, choose }) {
  const drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "well", role: "img", "aria-labelledby": "well-words" });
  const words = html("p", { id: "well-words", class: "unseen" });
  const away = absence("source");
  const element = panel(t("Wet well and pumps"), away.element, drawing, words);
  element.classList.add("is-well");
  let pumps = [];
  let mains = [];
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
    mains = station.mains.map((_, place) => svg("g", { class: "main" },
      svg("line", { class: "pipe", x1: left, x2: right, y1: pipeY(place), y2: pipeY(place) }),
      svg("path", { class: "arrow", d: `M${right} ${pipeY(place)}l-12 -7v14z` }),
      svg("title")));
    drawing.replaceChildren(
      svg("pattern", { id: "hatch", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
        svg("rect", { class: "hatch-ground", width: 8, height: 8 }), svg("line", { class: "hatch-line", x1: 0, x2: 0, y1: 0, y2: 8 })),
      ...mains,
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
    const level = reading(station, (row) => row[1]);
    const share = Number.isFinite(level.value) ? Math.min(1, Math.max(0, (level.value - floor()) / depth())) : 0;
    water.style.transform = `scaleY(${share})`;
    grade(water, level.kind);
    say(levelText, `${figure(level.value, 2)} m`);
    grade(levelText, level.kind);
    mark(levelText, "y", (levelY(floor() + share * depth()) + 6).toFixed(0));
    const inflow = reading(station, (row) => row[2]);
    say(inflowText, inflow.kind === "never" ? t("inflow") : t("inflow {value} m³/h", { value: figure(inflow.value, 0) }));
    grade(inflowText, inflow.kind === "never" ? "good" : inflow.kind);
    mains.forEach((each, place) => showMain(each, place));
    const flows = station.mains.map((name, place) => ({ name: name ?? t("rising main"), ...mainFlow(place) }));
    say(mainText, flows.map(({ name, flow }, place) => `${name} ${figure(flow, 0)} m³/h${mainWords(place)}`).join("; "));
    grade(mainText, worst(flows.map(({ kind }) => kind)));
    const worstOfMain = station.causes.find(({ fault }) => isOfMain(fault))?.fault;
    mark(mainText, "class", worstOfMain ? `strong is-${kindOf(worstOfMain)}` : "");
    grade(drawing, station.shownKind);
    away.show(station.then || station.has("source") || station.shownKind === "never");
    say(element.querySelector("h2"), station.then ? t("Wet well and pumps at {time}", { time: moment(past.moment) }) : t("Wet well and pumps"));
    for (const each of pumps) each.update(station, chosen());
    const told = pumps.map((_, place) => t("pump {name} {does}, {state}", { name: station.called(place + 1), does: station.isRunning(place + 1) ? t("runs") : t("stands"), state: station.pumpLook(place + 1).word }));
    const reason = station.shownReason;
    told.push(...flows.map(({ name }, place) => mainWords(place) && `${name}${mainWords(place)}`).filter(Boolean));
    say(words, `${reason ? `${reason}. ` : ""}${t("Level {value} m.", { value: figure(level.value, 2) })} ${told.join("; ")}.`);
  }

  /** The pipe of a main in the colour of what is said of it; its pumps keep theirs. */
  function showMain(each, place) {
    const fault = station.mainFault(place);
    mark(each, "class", `main is-${fault ? kindOf(fault) : "calm"}${fault ? " fault" : ""}`);
    mark(each, "data-state", fault?.state ?? "normal");
    say(each.querySelector("title"), `${station.mains[place] ?? t("rising main")}${mainWords(place)}`);
  }

  function mainWords(place) {
    const fault = station.mainFault(place);
    if (!fault) return "";
    const stage = stageOf(fault);
    return `, ${state(fault.state).word}${stage ? `: ${stage.word}` : ""}`;
  }

  /** Flow of a main, and the worst of how good its parts are; a pump without a meter of flow does not count. */
  function mainFlow(place) {
    const parts = pumpsOf(place).map((number) => reading(station, (row) => station.pump(number, row).flow)).filter((part) => part.kind !== "never");
    return { flow: parts.length ? parts.reduce((sum, part) => sum + part.value, 0) : NaN, kind: parts.length ? worst(parts.map((part) => part.kind)) : station.shownKind };
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
  const hint = svg("title", {}, t("Pump {name}", { name: number }));
  const title = svg("text", { class: "name", x, y: 350, "text-anchor": "middle" }, t("Pump {name}", { name: number }));
  const doing = svg("text", { x, y: 367, "text-anchor": "middle" });
  const condition = svg("text", { class: "condition", x, y: 384, "text-anchor": "middle" });
  const element = svg("g", { class: "pump", onclick: () => choose(number) }, hint, pipe, body, badge, flow, head, title, doing, condition);
  let shown = "";

  function update(station, chosen) {
    const of = (name) => reading(station, (row) => station.pump(number, row)[name]);
    const [frequency, flowM3h, headM, power] = ["frequency", "flow", "head", "power"].map(of);
    const runs = station.isRunning(number);
    const seen = station.pumpLook(number);
    mark(element, "class", `pump is-${seen.kind}${runs ? " runs" : ""}${chosen === number ? " chosen" : ""}${seen.isFault ? " fault" : ""}`);
    mark(element, "data-state", seen.state);
    grade(element, station.shownKind);
    say(title, station.nameOf(number) ?? t("Pump {name}", { name: number }));
    say(hint, t("Pump {name}", { name: station.called(number) }));
    impeller.style.animationDuration = runs && frequency.value > 1 ? `${(45 / frequency.value).toFixed(1)}s` : "";
    for (const [node, told, unit, digits] of [[flow, flowM3h, "m³/h", 0], [head, headM, "m", 1]]) {
      say(node, runs ? `${figure(told.value, digits)} ${unit}` : "");
      grade(node, told.kind);
    }
    say(doing, runs ? `${figure(frequency.value, 0)} Hz, ${figure(power.value, 1)} kW` : station.shownKind === "never" ? NONE : t("stands"));
    grade(doing, runs ? worst([frequency.kind, power.kind === "never" ? frequency.kind : power.kind]) : station.shownKind);
    say(condition, seen.word);
    if (shown !== `${seen.state} ${seen.isFault}`) {
      shown = `${seen.state} ${seen.isFault}`;
      badge.replaceChildren(...(seen.isFault ? [icon(seen.state, 20)] : []));
    }
  }
  return { element, update };
}
