// The address holds the view: page and station in the path, all else in the query.

const listeners = new Set();

export const query = (name, otherwise = "") => new URLSearchParams(location.search).get(name) ?? otherwise;

/** Changes the query without a new page; as a step that the browser's "back" undoes if so asked. */
export function remember(changes, { isStep = false } = {}) {
  const parameters = new URLSearchParams(location.search);
  for (const [name, value] of Object.entries(changes)) {
    if (value === "" || value == null) parameters.delete(name);
    else parameters.set(name, value);
  }
  const text = parameters.toString();
  const address = location.pathname + (text ? `?${text}` : "");
  if (isStep) history.pushState(null, "", address);
  else history.replaceState(null, "", address);
}

export function go(href) {
  history.pushState(null, "", href);
  listeners.forEach((listener) => listener());
}

export function onMove(listener) {
  listeners.add(listener);
  addEventListener("popstate", listener);
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("a[href^='/']");
    const plain = event.button === 0 && !event.ctrlKey && !event.metaKey && !event.shiftKey && !event.altKey;
    if (!link || !plain || link.target || link.hasAttribute("download")) return;
    event.preventDefault();
    go(keepTheme(link.getAttribute("href")));
  });
}

function keepTheme(href) {
  const theme = query("theme");
  return theme ? `${href}${href.includes("?") ? "&" : "?"}theme=${theme}` : href;
}
