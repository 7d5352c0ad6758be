// What the gap to the simulator is called, in the reader's language: effects, places, signals, times.

import { figure, millis, moment, words } from "../base/format.js";
import { assetWords } from "../base/states.js";
import { t } from "../base/words.js";

const SIGNALS = { flow: t("Flow"), head: t("Head"), power: t("Power"), level: t("Level"), start_level: t("Start levels"), stop_level: t("Stop levels"), telemetry: t("Telemetry") };
const REGIMES = { idle: t("while all stands"), start_ramp: t("at starts"), steady: t("while it runs steadily"), multi_pump: t("while several run"), stop_ramp: t("at stops") };

export const signalWords = (name) => SIGNALS[name] ?? words(name);

/** "flow/1/steady" in words; pump 0 is the station. */
export function groupWords(group, called) {
  const [signal, pump, regime] = group.split("/");
  const values = { signal: signalWords(signal), name: called(Number(pump)), regime: REGIMES[regime] ?? words(regime ?? "") };
  return Number(pump) ? t("{signal} of pump {name}, {regime}", values) : t("{signal}, {regime}", values);
}

/** One name of the gap: {effect, component, since, ended, fault}. */
export function nameWords(one, called) {
  const since = one.since ? t("since {time}", { time: moment(millis(one.since)) }) : t("from the first look on");
  const ended = one.ended ? `, ${t("over since {time}", { time: moment(millis(one.ended)) })}` : "";
  const fault = one.fault ? `; ${t("the detector tells it as a fault: {asset}", { asset: assetWords(one.fault, called) })}` : "";
  return `${words(one.component)}: ${effectWords(one.effect)}, ${since}${ended}${fault}`;
}

function effectWords(effect) {
  if (!effect) return t("something that no effect explains");
  const sizes = Object.values(effect.parameters ?? {}).map(({ value, ci, unit }) => {
    const size = typeof value === "number" ? short(value) : words(value);
    return `${size}${unit && unit !== "1" ? ` ${unit}` : ""}${ci ? ` (${ci.map(short).join(" – ")})` : ""}`;
  });
  return [words(effect.name), ...sizes].join(", ");
}

/** Three digits. */
const short = (value) => figure(value, Math.min(4, Math.max(0, 2 - Math.floor(Math.log10(Math.abs(value) || 1)))));
