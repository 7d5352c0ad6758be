// What the page knows of one station: takes frames, keeps the last samples, verdicts and alarms.

const MOST_ROWS = 1500;
const MOST_VERDICTS = 80;
const PUMP_VALUES = 4;
const FIRST_PUMP = 3;

export class StationState {
  constructor(name) {
    this.name = name;
    this.clear();
  }

  clear() {
    this.rows = [];
    this.running = [];
    this.quality = null;
    this.state = "unknown";
    this.stale = true;
    this.lost = 0;
    this.verdicts = new Map();
    this.alarms = new Map();
    this.statuses = new Map();
    this.alive = [];
    this.model = null;
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
    Object.assign(this, { running: frame.running, quality: frame.quality, state: frame.state, stale: frame.stale, lost: frame.lost });
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
      changed.add("services");
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

  verdict(number) {
    return this.verdicts.get(number)?.at(-1);
  }

  pumpState(number) {
    return this.verdict(number)?.state ?? "unknown";
  }
}
