// One way to draw lines over time: uPlot in the colours of the page, as wide as its place.

/* global uPlot */
import { html } from "./dom.js";
import { figure, moment } from "./format.js";
import { colour, onTheme } from "./theme.js";

export const PENS = ["pen1", "pen2", "pen3", "pen4"];
const DAY_S = 86_400;
const DASHES = [undefined, [7, 3], [2, 2], [9, 3, 2, 3]];

/** The pen of a pump: a colour and a dash each, so that none rests on colour alone. */
export const pen = (number) => ({ pen: PENS[(number - 1) % PENS.length], dash: DASHES[(number - 1) % DASHES.length] });

/**
 * @param {string} label what is drawn, for those who do not see it
 * @param {() => object[]} series each {label, pen, dash, width, fill, band, paths, points, digits}; band: place of the other edge
 * @param {object} options {height, unit, sync, legend, onZoom, limits, range, splits, scale, ofDays}; ofDays: marks at days only
 */
export function chart(label, series, options = {}) {
  const element = html("div", { class: "chart", role: "img", "aria-label": label });
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
        height: options.height ?? 130,
        tzDate: (time) => uPlot.tzDate(new Date(time * 1000), "Etc/UTC"),
        legend: { show: Boolean(options.legend), live: options.legend === "live" },
        cursor: { sync: options.sync ? { key: options.sync } : undefined, drag: { x: Boolean(options.onZoom), y: false } },
        scales: { y: { ...options.scale, range: options.range ?? ((_, low, high) => spread(low, high)) } },
        axes: [
          { ...axis, space: 75, size: 30, incrs: options.ofDays && [1, 2, 7, 14].map((days) => days * DAY_S), values: (_, times, __, ___, step) => times.map((time) => moment(time * 1000).slice(...(step >= DAY_S ? [5, 10] : step < 60 ? [11, 19] : [11, 16]))) },
          { ...axis, size: 46, splits: options.splits, filter: options.splits && ((_, splits) => splits), label: options.unit, labelSize: options.unit ? 16 : 0, labelFont: "11px system-ui, sans-serif" },
        ],
        series: [
          { label: "time", value: (_, time) => (time == null ? "–" : `${moment(time * 1000)}`) },
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
          draw: options.limits ? [(self) => drawLimits(self, options.limits())] : [],
          setSelect: options.onZoom ? [(self) => zoomed(self)] : [],
        },
      },
      data,
      element,
    );
  }

  function zoomed(self) {
    const { left, width } = self.select;
    if (width < 5) return;
    options.onZoom(self.posToVal(left, "x") * 1000, self.posToVal(left + width, "x") * 1000);
  }

  function update(values) {
    data = values;
    const wanted = JSON.stringify(series().map(({ label: name, width }) => [name, width]));
    if (!plot || wanted !== form) {
      form = wanted;
      build();
    } else {
      plot.setData(data);
    }
  }

  const size = new ResizeObserver(() => plot?.setSize({ width: Math.max(120, element.clientWidth), height: options.height ?? 130 }));
  size.observe(element);
  const endTheme = onTheme(() => plot && build());
  function end() {
    size.disconnect();
    endTheme();
    plot?.destroy();
  }
  return { element, update, end };
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
