// A live view: the whole state by request, then what changes by server-sent events; begins anew when something is missed.

const AGAIN_MS = 1000;
const MISSING_MS = 5000;

/**
 * @param {string} events address of the event stream
 * @param {string} state address of the whole state, in the form of an event
 * @param {{begin: Function, apply: Function, link: Function, missing: Function}} view; missing: there is no such thing
 * @returns {Function} ends it
 */
export function follow(events, state, view) {
  let source = null;
  let waiting = null; // events that come while the state is asked for
  let ended = false;
  let retry = 0;

  async function load() {
    const mine = (waiting = []);
    try {
      const answer = await fetch(state);
      if (answer.status === 404 && view.missing && !ended && waiting === mine) {
        view.missing();
        view.link(true);
        clearTimeout(retry);
        retry = setTimeout(() => !ended && source && load(), MISSING_MS);
        return;
      }
      if (!answer.ok) throw new Error(answer.statusText);
      const whole = await answer.json();
      if (ended || waiting !== mine) return;
      waiting = null;
      view.begin(whole);
      view.link(true);
      mine.filter((event) => event.id > whole.id).forEach(view.apply);
    } catch {
      if (!ended && waiting === mine) later(load);
    }
  }

  function later(act) {
    view.link(false);
    clearTimeout(retry);
    retry = setTimeout(() => !ended && source && act(), AGAIN_MS);
  }

  function open() {
    source?.close();
    source = new EventSource(events);
    source.addEventListener("resync", load);
    source.addEventListener("error", () => {
      view.link(false);
      if (source?.readyState === EventSource.CLOSED) later(open);
    });
    source.addEventListener("message", (message) => {
      const event = JSON.parse(message.data);
      if (waiting) waiting.push(event);
      else view.apply(event);
    });
  }

  function close() {
    clearTimeout(retry);
    source?.close();
    source = null;
    waiting = null;
  }

  // A page that nobody sees costs nothing, and leaves the browser's few connections to the others.
  const look = () => (document.hidden ? close() : source ?? open());
  document.addEventListener("visibilitychange", look);
  look();
  return () => {
    ended = true;
    document.removeEventListener("visibilitychange", look);
    close();
  };
}
