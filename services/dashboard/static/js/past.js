// What the historian kept of a station.

/** Columns of a time span; times in ms since 1970. */
export async function pastOf(station, kind, start, end, points) {
  const span = new URLSearchParams({ kind, start: new Date(start).toISOString(), end: new Date(end).toISOString(), points });
  const answer = await fetch(`/api/stations/${encodeURIComponent(station)}/history?${span}`);
  const told = await answer.json();
  if (told.error) throw new Error(told.error);
  return { times: told.time.map((stamp) => Date.parse(stamp)), columns: told.columns, messages: told.messages };
}
