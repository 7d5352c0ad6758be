// What is asked of the past of a station. Times are in ms since 1970.

async function asked(station, what, parameters) {
  const span = new URLSearchParams(Object.entries(parameters).filter(([, value]) => value != null).map(([name, value]) =>
    [name, name === "start" || name === "end" || name === "from" || name === "to" ? new Date(value).toISOString() : value]));
  const answer = await fetch(`/api/stations/${encodeURIComponent(station)}/${what}?${span}`);
  const told = await answer.json().catch(() => ({ error: answer.statusText }));
  if (told.error || !answer.ok) throw new Error(told.error || answer.statusText);
  return told;
}

/** Columns of samples of a time span: {times, columns}. */
export async function trendsOf(station, start, end, points) {
  const { time, columns } = await asked(station, "trends", { start, end, points });
  return { times: time, columns };
}

/** Bands of verdicts and alarms: {verdicts, alarms}, each with from and to. */
export const bandsOf = (station, start, end) => asked(station, "bands", { start, end });

/** Columns or messages of a kind that the historian knows. */
export async function pastOf(station, kind, start, end, points) {
  const told = await asked(station, "history", { kind, start, end, points });
  return { times: told.time.map((stamp) => Date.parse(stamp)), columns: told.columns, messages: told.messages };
}

/** Episodes that reach into a span. */
export const episodesOf = async (station, from, to) => (await asked(station, "episodes", { from, to })).episodes;

/** Acts of maintenance, with what the detector saw of each. */
export const actsOf = async (station) => (await asked(station, "maintenance", {})).maintenance;
