// The plane of flow and head: a pump fault slides the operating point along the system curve, a fault of the main
// slides it along the pump curve.

import { html, mark, panel, say, svg } from "./dom.js";
import { figure, signed } from "./format.js";

const WIDTH = 640;
const HEIGHT = 400;
const BOX = { left: 52, right: 620, top: 14, bottom: 356 };
const TRAIL = 240;
const FADES = 4;
const NEAR_NOMINAL = 0.97;

export function planePanel(station, chosen) {
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
    ...[["configured", "as configured"], ["learnt", "learnt, with 95 % band"], ["now", "as the last run shows"]]
      .map(([kind, word]) => html("li", {}, html("span", { class: `stroke ${kind}` }), word)),
    html("li", {}, html("span", { class: "dot" }), "operating point and trail, hollow while the pump stands"));
  const element = panel("Operating point", drawing, key, words);
  element.classList.add("is-plane");
  const title = element.querySelector("h2");
  let reach = { flow: 300, head: 40 };

  const x = (flow) => BOX.left + ((BOX.right - BOX.left) * flow) / reach.flow;
  const y = (head) => BOX.bottom - ((BOX.bottom - BOX.top) * head) / reach.head;
  const model = () => station.model?.pumps.find((each) => each.pump === chosen());

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
      svg("text", { class: "axis", x: (BOX.left + BOX.right) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, "Flow, m³/h"),
      svg("text", { class: "axis", transform: `translate(13 ${middle}) rotate(-90)`, "text-anchor": "middle" }, "Head, m"));
  }

  function drawCurves() {
    const known = model();
    if (!known) {
      curves.replaceChildren();
      return;
    }
    const verdict = station.pumpState(chosen());
    const isPump = verdict === "pump_fault" || verdict === "pump_and_system_fault";
    const isMain = verdict === "system_fault" || verdict === "pump_and_system_fault";
    curves.replaceChildren(
      line(known.configured_pump, "configured"), line(known.configured_system, "configured"),
      band(known.learnt_pump, "learnt"), band(known.learnt_system, "learnt"),
      line(known.learnt_pump, "learnt"), line(known.learnt_system, "learnt"),
      band(known.now_pump, isPump ? "now fault" : "now"), band(known.now_system, isMain ? "now fault" : "now"),
      line(known.now_pump, isPump ? "now fault" : "now"), line(known.now_system, isMain ? "now fault" : "now"),
      label(known.now_pump ?? known.learnt_pump ?? known.configured_pump, 0.62, isPump ? "pump curve, moved" : "pump curve", -6),
      label(known.now_system ?? known.learnt_system ?? known.configured_system, 0.26, isMain ? "system curve, moved" : "system curve", 14),
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

  function drawPoints() {
    const points = [];
    const nominal = station.model?.nominal_frequency_hz ?? 50;
    for (const row of station.rows.slice(-TRAIL)) {
      const { frequency, flow, head } = station.pump(chosen(), row);
      if (frequency >= NEAR_NOMINAL * nominal && Number.isFinite(flow) && Number.isFinite(head)) points.push(`M${x(flow).toFixed(1)} ${y(head).toFixed(1)}h0`);
    }
    const size = Math.ceil(points.length / FADES);
    trail.replaceChildren(...Array.from({ length: size ? FADES : 0 }, (_, place) =>
      svg("path", { d: points.slice(place * size, (place + 1) * size).join(""), opacity: (place + 1) / FADES })));
    const { flow, head, frequency } = station.pump(chosen());
    const runs = station.isRunning(chosen()) && Number.isFinite(flow) && Number.isFinite(head);
    const last = points.at(-1)?.slice(1, -2);
    mark(point, "class", runs ? "point" : "point stands");
    mark(point, "visibility", runs || last ? "visible" : "hidden");
    if (runs || last) mark(point, "transform", `translate(${runs ? `${x(flow).toFixed(1)} ${y(head).toFixed(1)}` : last})`);
    const main = station.totalFlow(station.header(chosen()));
    const isShared = runs && main > 1.02 * flow;
    mark(total, "visibility", isShared ? "visible" : "hidden");
    if (isShared) mark(total, "transform", `translate(${x(main).toFixed(1)} ${y(head).toFixed(1)})`);
    const shift = station.verdict(chosen())?.evidence.shift_m;
    const moved = shift ? ` Last run: pump curve ${signed(shift.pump)} m, system curve ${signed(shift.system)} m.` : "";
    say(words, `${runs ? `${figure(flow, 0)} m³/h at ${figure(head, 1)} m and ${figure(frequency, 1)} Hz.` : "The pump stands."}${moved}`);
  }

  function update(changed) {
    say(title, `Operating point of pump ${station.called(chosen())}`);
    if (changed.has("model") || changed.has("pump") || changed.has("begin")) drawGround();
    if (["model", "pump", "verdicts", "begin"].some((name) => changed.has(name))) drawCurves();
    drawPoints();
  }

  drawGround();
  return { element, update };
}

function steps(reach) {
  const size = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000].find((each) => reach / each <= 8) ?? reach / 6;
  return Array.from({ length: Math.floor(reach / size) + 1 }, (_, place) => place * size);
}
