// An alarm in the words of the page.

import { t } from "../base/words.js";

export const PRIORITIES = ["urgent", "high", "medium", "low", "advisory"];
export const SHAPES = { urgent: "pump_and_system_fault", high: "pump_fault", medium: "system_fault", low: "sensor_fault", advisory: "learning" };
export const KINDS = { urgent: "urgent", high: "urgent", medium: "warn", low: "doubt", advisory: "calm" };

const RULES = {
  pump_fault: t("pump fault"), system_fault: t("system fault"), pump_and_system_fault: t("pump and system fault"), sensor_fault: t("sensor fault"),
  level_high: t("level high"), overflow_risk: t("level near overflow"), samples_stale: t("no samples"), plc_stopped: t("heartbeat of the PLC stands still"),
  plc_lost: t("PLC does not answer"), detector_silent: t("detector is not running"), gateway_silent: t("gateway is not running"),
  historian_silent: t("historian is not running"), bus_lost: t("alarms had no router"),
};

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
export const ruleWord = (alarm) => RULES[ruleOf(alarm)] ?? ruleOf(alarm).replaceAll("_", " ");
export const stateWord = (name) => STATES[name] ?? t(name.replaceAll("_", " "));
export const actWord = (name) => ACTS[name] ?? t(name.replaceAll("_", " "));
export const priorityWord = (name) => PRIORITY_WORDS[name] ?? name;

/** Whether an alarm waits for somebody to acknowledge it. */
export const isOpen = (alarm) => alarm.state === "unacknowledged" || alarm.state === "returned" || alarm.state === "latched_unacknowledged";

export const isPutAside = (alarm) => alarm.state === "shelved" || alarm.state === "out_of_service" || alarm.state === "suppressed";

/** What the daemon says of it, after what kind of alarm it is, where that is not the same. */
export function textOf(alarm) {
  const word = ruleWord(alarm);
  return alarm.text.includes(word) || !alarm.text ? alarm.text || word : `${word} – ${alarm.text}`;
}
