// What the page knows of one station: takes frames, keeps the last samples, verdicts and alarms.

import { STATION } from "../alarms/alarm_words.js";
import { millis } from "../base/format.js";
import { Currency } from "../base/quality.js";
import { faultsOf, isOfMain, kindOf, speaksOf, stageOf, state } from "../base/states.js";
import { t } from "../base/words.js";

const MOST_ROWS = 1500;
const MOST_VERDICTS = 80;
const PUMP_VALUES = 4;
const FIRST_PUMP = 3;

const rank = (fault) => 10 * (stageOf(fault)?.rank ?? 3) + state(fault.state).rank;

export class StationState {
  constructor(name) {
    this.name = name;
    this.currency = new Currency();
    this.clear();
  }

  clear() {
    this.rows = [];
    this.running = [];
    this.currency.clear();
    this.state = "unknown";
    this.lost = 0;
    this.lookAt(null);
    this.verdicts = new Map();
    this.alarms = new Map();
    this.statuses = new Map();
    this.alive = [];
    this.site = [];
    this.model = null;
    this.gap = null;
  }

  /** Looks at a moment of the past: {verdicts, row}, verdicts by pump; null for now. */
  lookAt(past) {
    this.then = past?.verdicts ?? null;
    this.thenRow = past?.row ?? null;
  }

  /** What is drawn of: the last samples, or that of the moment of the past. */
  get shownRows() {
    if (!this.then) return this.rows;
    return this.thenRow ? [this.thenRow] : [];
  }

  /** How good what is drawn is: what was kept of the past is as good as it was. */
  get shownKind() {
    if (!this.then) return this.currency.kind;
    return this.thenRow ? "good" : "never";
  }

  get shownReason() {
    return this.then ? "" : this.currency.reason;
  }

  /** Takes a frame; returns the names of what has changed. */
  take(frame) {
    const changed = new Set();
    if (frame.begins) {
      this.rows = [];
      changed.add("rows");
    }
    if (frame.rows.length) {
      this.rows.push(...frame.rows);
      if (this.rows.length > MOST_ROWS) this.rows.splice(0, this.rows.length - MOST_ROWS);
      changed.add("rows");
    }
    Object.assign(this, { running: frame.running, state: frame.state, lost: frame.lost });
    this.currency.take(frame);
    for (const verdict of frame.verdicts ?? []) {
      const told = this.verdicts.get(verdict.pump) ?? [];
      told.push(verdict);
      if (told.length > MOST_VERDICTS) told.shift();
      this.verdicts.set(verdict.pump, told);
      changed.add("verdicts");
    }
    for (const alarm of frame.alarms ?? []) {
      this.alarms.set(alarm.id, alarm);
      changed.add("alarms");
    }
    for (const status of frame.statuses ?? []) {
      this.statuses.set(status.service, status);
      changed.add("services");
    }
    if (frame.alive) {
      this.alive = frame.alive;
      this.site = frame.site ?? [];
      changed.add("services");
    }
    if (frame.gap) {
      this.gap = frame.gap;
      changed.add("gap");
    }
    if (frame.model) {
      this.model = frame.model;
      changed.add("model");
    }
    return changed;
  }

  get last() {
    return this.rows.at(-1);
  }

  get time() {
    return this.last?.[0];
  }

  get level() {
    return this.last?.[1];
  }

  get inflow() {
    return this.last?.[2];
  }

  get pumps() {
    const byRows = this.last ? (this.last.length - FIRST_PUMP) / PUMP_VALUES : 0;
    return Math.max(byRows, this.model?.pumps.length ?? 0);
  }

  /** Values of a pump (from 1) in a row. */
  pump(number, row = this.last) {
    const [frequency, flow, head, power] = row?.slice(FIRST_PUMP + PUMP_VALUES * (number - 1)) ?? [];
    return { frequency, flow, head, power };
  }

  isRunning(number) {
    if (this.then) return (this.pump(number, this.thenRow).frequency ?? 0) > 0;
    return this.running[number - 1] ?? (this.pump(number).frequency ?? 0) > 0;
  }

  /** Sum of the flows in the last row, of all pumps or of some (from 1). */
  totalFlow(pumps = Array.from({ length: this.pumps }, (_, place) => place + 1)) {
    return pumps.reduce((total, pump) => total + (this.pump(pump).flow ?? 0), 0);
  }

  /** What people call a pump, where the station file has a name for it. */
  nameOf(number) {
    return this.model?.pumps.find((each) => each.pump === number)?.name ?? null;
  }

  /** Number of a pump, with its name where it has one: "7 (2.3)". */
  called(number) {
    const name = this.nameOf(number);
    return name ? `${number} (${name})` : String(number);
  }

  /** Names of the mains, in the order of their pumps; one without a name where nothing is known of them. */
  get mains() {
    return [...new Set(this.model?.pumps.map((each) => each.main ?? null) ?? [null])];
  }

  /** Place of a pump's main among them. */
  mainOf(number) {
    return Math.max(0, this.mains.indexOf(this.model?.pumps.find((each) => each.pump === number)?.main ?? null));
  }

  /** Pumps on the common header of a pump, none where it has a pipe of its own. */
  header(number) {
    return this.model?.pumps.find((each) => each.pump === number)?.header ?? [];
  }

  /** What is said of a pump: at the moment of the past that is looked at, else last. */
  verdict(number) {
    return this.then ? this.then.get(number)?.at(-1) : this.verdicts.get(number)?.at(-1);
  }

  /** State of a pump, without a fault of its main that stands no more. */
  pumpState(number) {
    const told = this.verdict(number)?.state ?? "unknown";
    const isOver = faultsOf(this.verdict(number)).some(isOfMain) && !this.faults(number).some(isOfMain);
    return (isOver && { system_fault: "normal", pump_and_system_fault: "pump_fault" }[told]) || told;
  }

  /** Faults that the verdict on a pump tells, but for those of which the newest verdict on that asset, of whatever pump, says nothing. */
  faults(number) {
    return faultsOf(this.verdict(number)).filter(({ asset }) => {
      const newest = this.judged.findLast((verdict) => speaksOf(verdict, asset));
      return !newest || faultsOf(newest).some((fault) => fault.asset === asset);
    });
  }

  /** What is said of each pump, the newest last. */
  get judged() {
    return this.numbers.map((number) => this.verdict(number)).filter(Boolean).sort((a, b) => millis(a.time) - millis(b.time));
  }

  /** How a pump is drawn: a fault of its main is no fault of the pump. */
  pumpLook(number) {
    const verdict = this.verdict(number);
    const faults = this.faults(number);
    const own = faults.find((fault) => !isOfMain(fault));
    if (own) return { kind: kindOf(own), word: state(own.state).word, isFault: true, state: own.state };
    if (faults.length) return { kind: "calm", word: t("see main"), isFault: false, state: "normal" };
    const now = this.pumpState(number);
    return { kind: verdict ? (now === verdict.state ? kindOf(verdict) : state(now).kind) : "doubt", word: state(now).word, isFault: false, state: now };
  }

  /** The fault of a main (by its place), the worst that its pumps tell; undefined if none does. */
  mainFault(place) {
    return this.causes.find(({ fault, pump }) => isOfMain(fault) && this.mainOf(pump) === place)?.fault;
  }

  /** What is at fault, each asset once as the newest verdict tells it, the gravest first: {fault, pump, verdict}. */
  get causes() {
    const found = new Map();
    for (const verdict of this.judged)
      for (const fault of this.faults(verdict.pump)) found.set(fault.asset, { fault, pump: verdict.pump, verdict });
    return [...found.values()].sort((a, b) => rank(b.fault) - rank(a.fault));
  }

  /** What somebody has put the station into, as an alarm tells it: under maintenance, stopped; undefined in operation. */
  get mode() {
    return [...this.alarms.values()].find((alarm) => alarm.id === STATION && alarm.state !== "normal");
  }

  get numbers() {
    return Array.from({ length: this.pumps }, (_, place) => place + 1);
  }

  /** Whether a service that matters to this page lives. */
  has(service) {
    if (service === "source") return this.currency.kind === "good" || this.currency.kind === "bad";
    return this.alive.includes(service) || this.site.includes(service);
  }
}
