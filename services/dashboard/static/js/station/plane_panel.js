// The plane of flow and head: a pump fault slides the operating point along the system curve, a fault of the main
// slides it along the pump curve.

import { html, mark, panel, say, svg } from "../base/dom.js";
import { figure, moment, signed } from "../base/format.js";
import { grade } from "../base/quality.js";
import { faultsOf, isOfMain } from "../base/states.js";
import { t } from "../base/words.js";
import { movedCurves } from "./moved_curves.js";

const WIDTH = 640;
const HEIGHT = 400;
const BOX = { left: 52, right: 620, top: 14, bottom: 356 };
const TRAIL = 240;
const FADES = 4;
const NEAR_NOMINAL = 0.97;

export function planePanel({ station, past, chosen }) {
  const ground = svg("g");
  const curves = svg("g", { "clip-path": "url(#plane-clip)" });
  const trail = svg("g", { class: "trail", "clip-path": "url(#plane-clip)" });
  const point = svg("g", { class: "point" }, svg("circle", { r: 10, class: "halo" }), svg("circle", { r: 5 }));
  const total = svg("path", { class: "total", d: "M-6 0H6M0-6V6" });
  const drawing = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "plane", role: "img", "aria-labelledby": "plane-words" },
    svg("clipPath", { id: "plane-clip" }, svg("rect", { x: BOX.left, y: BOX.top, width: BOX.right - BOX.left, height: BOX.bottom - BOX.top })),
    ground, curves, trail, total, point);
  const words = html("p", { id: "plane-words", class: "note" });
  const key = html("ul", { class: "key" },
    ...[["configured", t("as configured")], ["learnt", t("learnt, with 95 % band")], ["now", t("as the last run shows")]]
      .map(([kind, word]) => html("li", {}, html("span", { class: `stroke ${kind}` }), word)),
    html("li", {}, html("span", { class: "dot" }), t("operating point and trail, hollow while the pump stands")));
  const element = panel(t("Operating point"), drawing, key, words);
  element.classList.add("is-plane");
  const title = element.querySelector("h2");
  let reach = { flow: 300, head: 40 };

  const x = (flow) => BOX.left + ((BOX.right - BOX.left) * flow) / reach.flow;
  const y = (head) => BOX.bottom - ((BOX.bottom - BOX.top) * head) / reach.head;
  const configured = () => station.model?.pumps.find((each) => each.pump === chosen());
  /** The curves; of the past with the shift that the verdict of that time tells. */
  const model = () => (station.then ? movedCurves(configured(), station.verdict(chosen())) : configured());

  function drawGround() {
    const known = model();
    if (known) reach = { flow: known.configured_pump.flow_m3h.at(-1), head: 1.12 * Math.max(...known.configured_pump.head_m) };
    const lines = [];
    for (const flow of steps(reach.flow)) {
      lines.push(svg("line", { x1: x(flow), x2: x(flow), y1: BOX.top, y2: BOX.bottom }), svg("text", { x: x(flow), y: BOX.bottom + 16, "text-anchor": "middle" }, String(flow)));
    }
    for (const head of steps(reach.head)) {
      lines.push(svg("line", { x1: BOX.left, x2: BOX.right, y1: y(head), y2: y(head) }), svg("text", { x: BOX.left - 6, y: y(head) + 4, "text-anchor": "end" }, String(head)));
    }
    const middle = (BOX.top + BOX.bottom) / 2;
    ground.replaceChildren(svg("g", { class: "grid" }, ...lines),
      svg("text", { class: "axis", x: (BOX.left + BOX.right) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, t("Flow, {unit}", { unit: "m³/h" })),
      svg("text", { class: "axis", transform: `translate(13 ${middle}) rotate(-90)`, "text-anchor": "middle" }, t("Head, {unit}", { unit: "m" })));
  }

  function drawCurves() {
    const known = model();
    if (!known) {
      curves.replaceChildren();
      return;
    }
    const verdict = station.verdict(chosen());
    const faults = faultsOf(verdict);
    const isMain = faults.some(isOfMain);
    const isPump = faults.some((fault) => fault.asset.startsWith("pump"));
    curves.replaceChildren(
      line(known.configured_pump, "configured"), line(known.configured_system, "configured"),
      band(known.learnt_pump, "learnt"), band(known.learnt_system, "learnt"),
      line(known.learnt_pump, "learnt"), line(known.learnt_system, "learnt"),
      band(known.now_pump, isPump ? "now fault" : "now"), band(known.now_system, isMain ? "now fault" : "now"),
      line(known.now_pump, isPump ? "now fault" : "now"), line(known.now_system, isMain ? "now fault" : "now"),
      label(known.now_pump ?? known.learnt_pump ?? known.configured_pump, 0.62, isPump ? t("pump curve, moved") : t("pump curve"), -6),
      label(known.now_system ?? known.learnt_system ?? known.configured_system, 0.26, isMain ? t("system curve, moved") : t("system curve"), 14),
    );
  }

  function line(curve, kind) {
    if (!curve) return "";
    const points = curve.flow_m3h.map((flow, place) => `${x(flow).toFixed(1)} ${y(curve.head_m[place]).toFixed(1)}`);
    return svg("path", { class: `curve ${kind}`, d: `M${points.join("L")}` });
  }

  function band(curve, kind) {
    if (!curve?.low_m.length) return "";
    const above = curve.flow_m3h.map((flow, place) => `${x(flow).toFixed(1)} ${y(curve.high_m[place]).toFixed(1)}`);
    const below = curve.flow_m3h.map((flow, place) => `${x(flow).toFixed(1)} ${y(curve.low_m[place]).toFixed(1)}`).reverse();
    return svg("path", { class: `band ${kind}`, d: `M${above.join("L")}L${below.join("L")}Z` });
  }

  function label(curve, share, word, rise) {
    const place = Math.round(share * (curve.flow_m3h.length - 1));
    return svg("text", { class: "label", x: x(curve.flow_m3h[place]) + 8, y: y(curve.head_m[place]) + rise }, word);
  }

  /** Operating points (flow, head) of the chosen pump near nominal speed, oldest first: live, or of the hours before the moment. */
  function points() {
    const least = NEAR_NOMINAL * (station.model?.nominal_frequency_hz ?? 50);
    const isPoint = ({ frequency, flow, head }) => frequency >= least && Number.isFinite(flow) && Number.isFinite(head);
    if (!past.runs) return station.rows.slice(-TRAIL).map((row) => station.pump(chosen(), row)).filter(isPoint);
    const of = (name) => past.runs.columns[`pump${chosen()}_${name}`] ?? [];
    const slowest = of("frequency_hz_min").length ? of("frequency_hz_min") : of("frequency_hz");
    return past.runs.times.map((_, place) => ({ frequency: slowest[place], flow: of("flow_m3h")[place], head: of("head_m")[place] })).filter(isPoint);
  }

  function drawPoints() {
    const found = points();
    const marks = found.map(({ flow, head }) => `M${x(flow).toFixed(1)} ${y(head).toFixed(1)}h0`);
    const size = Math.ceil(marks.length / FADES);
    trail.replaceChildren(...Array.from({ length: size ? FADES : 0 }, (_, place) =>
      svg("path", { d: marks.slice(place * size, (place + 1) * size).join(""), opacity: past.runs ? 0.8 : (place + 1) / FADES })));
    const isLive = !past.runs;
    const now = isLive ? station.pump(chosen()) : (found.at(-1) ?? {});
    const runs = isLive ? station.isRunning(chosen()) && Number.isFinite(now.flow) && Number.isFinite(now.head) : found.length > 0;
    const last = marks.at(-1)?.slice(1, -2);
    mark(point, "class", runs ? "point" : "point stands");
    mark(point, "visibility", runs || last ? "visible" : "hidden");
    if (runs || last) mark(point, "transform", `translate(${runs ? `${x(now.flow).toFixed(1)} ${y(now.head).toFixed(1)}` : last})`);
    const main = isLive ? station.totalFlow(station.header(chosen())) : 0;
    const isShared = runs && main > 1.02 * now.flow;
    mark(total, "visibility", isShared ? "visible" : "hidden");
    if (isShared) mark(total, "transform", `translate(${x(main).toFixed(1)} ${y(now.head).toFixed(1)})`);
    grade(drawing, isLive ? station.currency.kind : "good");
    grade(words, isLive ? station.currency.kind : "good", isLive ? station.currency.reason : "");
    say(words, `${sentence(runs, now, isLive)}${shiftWords()}`);
  }

  function sentence(runs, { flow, head, frequency }, isLive) {
    const point = t("{flow} m³/h at {head} m and {frequency} Hz.", { flow: figure(flow, 0), head: figure(head, 1), frequency: figure(frequency, 1) });
    if (!isLive) {
      const time = t("At {time}, with the runs of three hours before; learnt curves are those of today.", { time: moment(past.moment) });
      return `${time} ${runs ? point : t("The pump did not run.")}`;
    }
    const { reason } = station.currency;
    if (station.currency.kind === "never") return reason;
    return `${reason ? `${reason}: ` : ""}${runs ? point : t("The pump stands.")}`;
  }

  function shiftWords() {
    const shift = station.verdict(chosen())?.evidence?.shift_m;
    return shift ? ` ${t("Last run: pump curve {pump} m, system curve {system} m.", { pump: signed(shift.pump), system: signed(shift.system) })}` : "";
  }

  function update(changed) {
    say(title, t("Operating point of pump {name}", { name: station.called(chosen()) }));
    if (["model", "pump", "begin"].some((name) => changed.has(name))) drawGround();
    if (["model", "pump", "verdicts", "begin", "then"].some((name) => changed.has(name))) drawCurves();
    drawPoints();
  }

  drawGround();
  return { element, update };
}

function steps(reach) {
  const size = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000].find((each) => reach / each <= 8) ?? reach / 6;
  return Array.from({ length: Math.floor(reach / size) + 1 }, (_, place) => place * size);
}
