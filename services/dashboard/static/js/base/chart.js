// One way to draw lines over time: uPlot in the colours of the page, as wide as its place.

/* global uPlot */
import { html } from "./dom.js";
import { ZONE, figure, moment } from "./format.js";
import { colour, onTheme } from "./theme.js";
import { t } from "./words.js";

export const PENS = ["pen1", "pen2", "pen3", "pen4"];
const DAY_S = 86_400;
const DASHES = [undefined, [7, 3], [2, 2], [9, 3, 2, 3]];

/** The pen of a pump: a colour and a dash each, so that none rests on colour alone. */
export const pen = (number) => ({ pen: PENS[(number - 1) % PENS.length], dash: DASHES[(number - 1) % DASHES.length] });

/**
 * @param {string} label what is drawn, for those who do not see it
 * @param {() => object[]} series each {label, pen, dash, width, fill, band, paths, points, digits}; band: place of the other edge
 * @param {object} options {height, unit, ticks, sync, legend, onZoom, onPick, onCursor, span, bands, marked, limits, range, splits, scale, ofDays}
 *   ofDays: marks at days only; span: [from, to] in ms that the axis shows; bands: spans of time that are shaded, each {from, to, pen};
 *   marked: a moment in ms with a line
 */
export function chart(label, series, options = {}) {
  const element = html("div", { class: "chart", role: "img", "aria-label": label });
  const tall = () => (typeof options.height === "function" ? options.height() : (options.height ?? 130));
  let plot = null;
  let form = "";
  let data = [[]];

  function build() {
    plot?.destroy();
    const ink = colour("muted");
    const grid = { stroke: colour("soft"), width: 1 };
    const axis = { stroke: ink, grid, ticks: grid, font: "11px system-ui, sans-serif" };
    const lines = series();
    plot = new uPlot(
      {
        width: Math.max(120, element.clientWidth),
        height: tall(),
        tzDate: (time) => (ZONE ? uPlot.tzDate(new Date(time * 1000), "Etc/UTC") : new Date(time * 1000)),
        legend: { show: Boolean(options.legend), live: options.legend === "live" },
        cursor: { sync: options.sync ? { key: options.sync } : undefined, drag: { x: Boolean(options.onZoom), y: false, setScale: false }, points: { size: 6 } },
        scales: { x: { range: (_, low, high) => options.span?.()?.map((ms) => ms / 1000) ?? [low, high] }, y: { ...options.scale, range: options.range ?? ((_, low, high) => spread(low, high)) } },
        axes: [
          { ...axis, space: 75, size: 30, incrs: options.ofDays && [1, 2, 7, 14].map((days) => days * DAY_S), values: (_, times, __, ___, step) => times.map((time) => moment(time * 1000).slice(...(step >= DAY_S ? [5, 10] : step < 60 ? [11, 19] : [11, 16]))) },
          { ...axis, size: options.unit ? 46 : 62, splits: options.splits, filter: options.splits && ((_, splits) => splits), ...(options.ticks ? { values: options.ticks, grid: { show: false } } : {}), label: options.unit, labelSize: options.unit ? 16 : 0, labelFont: "11px system-ui, sans-serif" },
        ],
        series: [
          { label: t("time"), value: (_, time) => (time == null ? "–" : `${moment(time * 1000)}`) },
          ...lines.map((line) => ({
            label: line.label,
            stroke: line.pen ? colour(line.pen) : undefined,
            fill: line.fill ? colour(line.fill) : undefined,
            dash: line.dash,
            width: line.width ?? 1.5,
            points: line.points ?? { show: false },
            paths: line.paths,
            spanGaps: false,
            value: (_, value) => (value == null ? "–" : figure(value, line.digits ?? 2)),
          })),
        ],
        bands: lines.flatMap((line, place) => (line.band ? [{ series: [place + 1 + line.band, place + 1], fill: colour("soft") }] : [])),
        hooks: {
          drawClear: options.bands ? [(self) => drawBands(self, options.bands())] : [],
          draw: [(self) => drawLimits(self, options.limits?.() ?? []), (self) => drawMark(self, options.marked?.())],
          setSelect: options.onZoom ? [(self) => zoomed(self)] : [],
          setCursor: options.onCursor ? [(self) => options.onCursor(self.cursor.left >= 0 ? self.posToVal(self.cursor.left, "x") * 1000 : null)] : [],
          ready: options.onPick ? [(self) => self.over.addEventListener("click", (event) => picked(self, event))] : [],
        },
      },
      data,
      element,
    );
  }

  let isZoom = false; // a drag ends with a click, which picks nothing

  function zoomed(self) {
    const { left, width } = self.select;
    if (width < 5) return;
    isZoom = true;
    setTimeout(() => (isZoom = false));
    self.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    options.onZoom(self.posToVal(left, "x") * 1000, self.posToVal(left + width, "x") * 1000);
  }

  function picked(self, event) {
    if (isZoom) return;
    const { left } = self.over.getBoundingClientRect();
    options.onPick(self.posToVal(event.clientX - left, "x") * 1000);
  }

  function update(values) {
    data = values;
    const wanted = JSON.stringify([tall(), series().map(({ label: name, width }) => [name, width])]);
    if (!plot || wanted !== form) {
      form = wanted;
      build();
    } else {
      plot.setData(data);
    }
  }

  const size = new ResizeObserver(() => plot?.setSize({ width: Math.max(120, element.clientWidth), height: tall() }));
  size.observe(element);
  const endTheme = onTheme(() => plot && build());
  function end() {
    size.disconnect();
    endTheme();
    plot?.destroy();
  }
  return { element, update, end, redraw: () => plot?.redraw() };
}

function drawBands(plot, bands) {
  const { ctx, bbox } = plot;
  const edge = (ms) => Math.min(bbox.left + bbox.width, Math.max(bbox.left, plot.valToPos(ms / 1000, "x", true)));
  ctx.save();
  for (const { from, to, pen: name, lane, lanes } of bands) {
    const [left, right] = [edge(from), edge(to ?? Infinity)];
    if (right <= bbox.left || left >= bbox.left + bbox.width) continue;
    const high = lanes ? bbox.height / lanes : bbox.height;
    ctx.fillStyle = colour(name);
    ctx.fillRect(left, bbox.top + (lanes ? lane * high + high * 0.14 : 0), Math.max(right - left, devicePixelRatio), lanes ? high * 0.72 : high);
  }
  ctx.restore();
}

function drawMark(plot, ms) {
  if (ms == null) return;
  const { ctx, bbox } = plot;
  const x = plot.valToPos(ms / 1000, "x", true);
  if (!(x >= bbox.left && x <= bbox.left + bbox.width)) return;
  ctx.save();
  ctx.strokeStyle = colour("ink");
  ctx.lineWidth = devicePixelRatio;
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  ctx.restore();
}

function spread(low, high) {
  if (low == null) return [0, 1];
  const room = Math.max((high - low) * 0.08, Math.abs(high) * 0.01, 0.01);
  return [low >= 0 && low - room < 0 ? 0 : low - room, high + room];
}

function drawLimits(plot, limits) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  for (const { value, word } of limits) {
    const y = plot.valToPos(value, "y", true);
    if (!(y > bbox.top && y < bbox.top + bbox.height)) continue;
    ctx.strokeStyle = ctx.fillStyle = colour("steel");
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([4 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
    ctx.lineWidth = 4 * devicePixelRatio;
    ctx.strokeStyle = colour("panel");
    ctx.strokeText(word, bbox.left + bbox.width - 3, y - 3 * devicePixelRatio);
    ctx.fillText(word, bbox.left + bbox.width - 3, y - 3 * devicePixelRatio);
  }
  ctx.restore();
}
