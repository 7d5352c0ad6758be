// What a station or a pump can be: word, shape and colour, and how much it asks for attention.

import { html, svg } from "./dom.js";

export const STATES = {
  pump_and_system_fault: { word: "pump and system fault", kind: "urgent", rank: 7, shape: "M8 1 15 8 8 15 1 8Z" },
  pump_fault: { word: "pump fault", kind: "urgent", rank: 6, shape: "M8 1 15.5 14.5H.5Z" },
  system_fault: { word: "system fault", kind: "urgent", rank: 6, shape: "M1.5 1.5h13v13h-13Z" },
  sensor_fault: { word: "sensor fault", kind: "sensor", rank: 5, shape: "M.5 1.5h15L8 15Z" },
  no_data: { word: "no data", kind: "gone", rank: 4, shape: "M2 2 14 14M14 2 2 14", open: true },
  unknown: { word: "unknown", kind: "doubt", rank: 3, shape: "M5 5.5a3 3 0 1 1 4.3 2.7Q8 9 8 10.5M8 13v1.5", open: true },
  learning: { word: "learning", kind: "calm", rank: 2, shape: "M8 2a6 6 0 1 0 6 6M8 8V4", open: true },
  normal: { word: "normal", kind: "calm", rank: 1, shape: "M8 3a5 5 0 1 0 .01 0Z", open: true },
};

export const state = (name) => STATES[name] ?? STATES.unknown;

export const isFault = (name) => state(name).rank >= 5;

export function icon(name, size = 16) {
  const { shape, open } = state(name);
  const paint = open ? { fill: "none", stroke: "currentColor", "stroke-width": 2 } : { fill: "currentColor" };
  return svg("svg", { viewBox: "0 0 16 16", width: size, height: size, "aria-hidden": "true" }, svg("path", { d: shape, ...paint }));
}

/** Shape and word, in the colour of the state. */
export const chip = (name, word = state(name).word) =>
  html("span", { class: `state is-${state(name).kind}`, "data-state": name }, icon(name), html("span", {}, word));
