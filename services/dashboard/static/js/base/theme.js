// Light, dark, or as the system has it.

import { query, remember } from "./address.js";

const listeners = new Set();

function show(theme) {
  document.documentElement.dataset.theme = theme;
  listeners.forEach((listener) => listener());
}

export function startTheme() {
  const select = document.getElementById("theme");
  select.value = query("theme") || localStorage.getItem("theme") || "auto";
  select.addEventListener("change", () => {
    localStorage.setItem("theme", select.value);
    remember({ theme: select.value === "auto" ? "" : select.value });
    show(select.value);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => show(select.value));
}

/** Calls back when colours change; returns what ends that. */
export function onTheme(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Colour of this name as a canvas takes it, in the scheme that is shown. */
export function colour(name) {
  const { style } = document.documentElement;
  style.outlineColor = `var(--${name})`;
  const shown = getComputedStyle(document.documentElement).outlineColor;
  style.outlineColor = "";
  return shown;
}
