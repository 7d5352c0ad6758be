// What a station or a pump can be: word, shape and colour, and how much it asks for attention.

import { html, svg } from "./dom.js";
import { t } from "./words.js";

export const STATES = {
  pump_and_system_fault: { word: t("pump and system fault"), kind: "urgent", rank: 7, shape: "M8 1 15 8 8 15 1 8Z" },
  pump_fault: { word: t("pump fault"), kind: "urgent", rank: 6, shape: "M8 1 15.5 14.5H.5Z" },
  system_fault: { word: t("system fault"), kind: "urgent", rank: 6, shape: "M1.5 1.5h13v13h-13Z" },
  sensor_fault: { word: t("sensor fault"), kind: "sensor", rank: 5, shape: "M.5 1.5h15L8 15Z" },
  no_data: { word: t("no data"), kind: "gone", rank: 4, shape: "M2 2 14 14M14 2 2 14", open: true },
  unknown: { word: t("unknown"), kind: "doubt", rank: 3, shape: "M5 5.5a3 3 0 1 1 4.3 2.7Q8 9 8 10.5M8 13v1.5", open: true },
  learning: { word: t("learning"), kind: "calm", rank: 2, shape: "M8 2a6 6 0 1 0 6 6M8 8V4", open: true },
  normal: { word: t("normal"), kind: "calm", rank: 1, shape: "M8 3a5 5 0 1 0 .01 0Z", open: true },
};

/** What to do about a fault, by how far it has gone. A fault without a stage is told by its state alone. */
export const STAGES = {
  act: { word: t("act"), kind: "urgent", rank: 3, says: t("the action limit is passed: send a crew") },
  plan: { word: t("plan"), kind: "warn", rank: 2, says: t("more than half of the action limit: plan a visit") },
  watch: { word: t("watch"), kind: "doubt", rank: 1, says: t("there, but small: nothing to do yet") },
};

export const stageOf = (verdict) => STAGES[verdict?.stage] ?? null;

/** Colour of a verdict or a fault: by its stage where it has one, else by its state. */
export const kindOf = (verdict) => stageOf(verdict)?.kind ?? state(verdict?.state ?? "unknown").kind;

const STATE_OF = { pump: "pump_fault", main: "system_fault", sensor: "sensor_fault" };

/**
 * What a verdict says is at fault, the worst first: each {asset, state, stage, since, severity, trend, advice}. Earlier detectors told the
 * state alone.
 */
export function faultsOf(verdict) {
  if (verdict?.faults?.length) return verdict.faults.map((fault) => ({ ...fault, state: STATE_OF[fault.asset.split(":")[0]] ?? "unknown" }));
  if (!verdict || !isFault(verdict.state)) return [];
  const fault = { state: verdict.state, stage: verdict.stage ?? null, since: verdict.onset ?? verdict.time, severity: verdict.severity ?? null, trend: verdict.trend ?? null };
  const main = mainAsset(verdict);
  if (verdict.state === "pump_and_system_fault") return [{ ...fault, asset: `pump:${verdict.pump}`, state: "pump_fault" }, { ...fault, asset: main, state: "system_fault" }];
  return [{ ...fault, asset: verdict.asset ?? { system_fault: main, sensor_fault: `sensor:pump${verdict.pump}` }[verdict.state] ?? `pump:${verdict.pump}` }];
}

const mainAsset = (verdict) => (verdict.evidence?.main ? `main:${verdict.evidence.main}` : "main");

/** Whether a verdict says whether a fault of an asset stands: of its pump, its main, its meters and those of the wet well. */
export function speaksOf(verdict, asset) {
  if (!verdict || (!verdict.faults && verdict.state === "unknown")) return false;
  if (asset.startsWith("pump:")) return asset === `pump:${verdict.pump}`;
  if (asset.startsWith("main")) return asset === mainAsset(verdict);
  const pump = asset.match(/^sensor:pump(\d+)/)?.[1];
  return pump === undefined || Number(pump) === verdict.pump;
}

export const isOfMain = (fault) => fault.asset.startsWith("main");

const QUANTITIES = { frequency_hz: t("frequency"), flow_m3h: t("flow"), head_m: t("head"), power_kw: t("power"), level_m: t("level"), inflow_m3h: t("inflow") };

/** An asset in words; `called` gives the name of a pump by its number. */
export function assetWords(asset, called = String) {
  if (!asset) return "";
  const place = asset.indexOf(":");
  const [kind, which] = place < 0 ? [asset, ""] : [asset.slice(0, place), asset.slice(place + 1)];
  if (kind === "pump") return t("pump {name}", { name: called(Number(which)) });
  if (kind === "main") return which ? t("rising main {name}", { name: which }) : t("rising main");
  const [, pump, quantity] = which.match(/^pump(\d+)_?(.*)$/) ?? [null, null, which];
  const meter = QUANTITIES[quantity] ? t("meter of {quantity}", { quantity: QUANTITIES[quantity] }) : t("a meter");
  return pump ? t("{meter} of pump {name}", { meter, name: called(Number(pump)) }) : meter;
}

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
