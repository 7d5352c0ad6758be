// An alarm in the words of the page.

import { figure, lasting } from "../base/format.js";
import { STAGES, assetWords } from "../base/states.js";
import { t } from "../base/words.js";
import { sizeWords } from "../station/severity.js";

export const PRIORITIES = ["urgent", "high", "medium", "low", "advisory"];
export const SHAPES = { urgent: "pump_and_system_fault", high: "pump_fault", medium: "system_fault", low: "sensor_fault", advisory: "learning" };
export const KINDS = { urgent: "urgent", high: "urgent", medium: "warn", low: "doubt", advisory: "calm" };

const RULES = {
  pump_fault: t("pump fault"), system_fault: t("system fault"), pump_and_system_fault: t("pump and system fault"), sensor_fault: t("sensor fault"),
  model_gap: t("the station has left its simulator"), level_high: t("level high"), overflow_risk: t("level near overflow"), samples_stale: t("no samples"),
  plc_stopped: t("heartbeat of the PLC stands still"), plc_lost: t("PLC does not answer"), detector_silent: t("detector is not running"),
  gateway_silent: t("gateway is not running"), historian_silent: t("historian is not running"), bus_lost: t("alarms had no router"),
};

/** What a text of the service says behind the words of its rule, and how the page says it. */
const FIGURES = [
  [/: (-?[\d.]+) m, limit (-?[\d.]+) m$/, (level, limit) => t(": {level} m, limit {limit} m", { level: figure(Number(level), 2), limit: figure(Number(limit), 2) })],
  [/ for (\d+) s$/, (seconds) => t(" for {span}", { span: lasting(Number(seconds)) })],
];

/** In place of an alarm: what the station was put into, such as "under maintenance", and what that suppresses. */
export const STATION = "station";

const STATES = {
  normal: t("normal"), unacknowledged: t("unacknowledged"), acknowledged: t("acknowledged"), returned: t("returned"), shelved: t("shelved"),
  out_of_service: t("out of service"), latched_unacknowledged: t("latched, unacknowledged"), latched_acknowledged: t("latched, acknowledged"), suppressed: t("suppressed by design"),
};

const ACTS = {
  acknowledge: t("acknowledge"), shelve: t("shelve"), unshelve: t("unshelve"), out_of_service: t("out of service"), in_service: t("in service"), reset: t("reset"),
  maintenance: t("under maintenance"), stop: t("stopped"), resume: t("back in operation"),
};

const PRIORITY_WORDS = { urgent: t("urgent"), high: t("high"), medium: t("medium"), low: t("low"), advisory: t("advisory") };

export const ruleOf = (alarm) => alarm.id.split(".").at(-1);
export const ruleWord = (alarm) => (alarm.id === STATION ? t("mode of the station") : null) ?? RULES[ruleOf(alarm)] ?? ruleOf(alarm).replaceAll("_", " ");
export const stateWord = (name) => STATES[name] ?? t(name.replaceAll("_", " "));
export const actWord = (name) => ACTS[name] ?? t(name.replaceAll("_", " "));
export const priorityWord = (name) => PRIORITY_WORDS[name] ?? name;

/** Whether an alarm waits for somebody to acknowledge it. */
export const isOpen = (alarm) => alarm.state === "unacknowledged" || alarm.state === "returned" || alarm.state === "latched_unacknowledged";

export const isPutAside = (alarm) => alarm.state === "shelved" || alarm.state === "out_of_service" || alarm.state === "suppressed";

/** What is the matter, in the reader's language; what the service tells in words of its own comes behind the kind of alarm. */
export function textOf(alarm) {
  const word = ruleWord(alarm);
  if (alarm.id === STATION) return t(alarm.text);
  if (alarm.asset && alarm.severity) return [`${word} – ${assetWords(alarm.asset)}${alarm.stage ? `: ${STAGES[alarm.stage].word}` : ""}`, ...sizeWords(alarm)].join(", ");
  for (const [form, words] of FIGURES) {
    const figures = alarm.text.match(form);
    if (figures) return `${word}${words(...figures.slice(1))}`;
  }
  const isSaid = !alarm.text || t(alarm.text) === word || alarm.text.includes(word);
  return isSaid ? (t(alarm.text) === word ? word : alarm.text || word) : `${word} – ${alarm.text}`;
}
