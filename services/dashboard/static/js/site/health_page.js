// Services of the site: who is there, and with which figures.

import { serviceWord } from "../base/absent.js";
import { html, say } from "../base/dom.js";
import { ago, measure } from "../base/format.js";
import { t } from "../base/words.js";

const AGAIN_MS = 2000;

export function healthPage(main, showLink) {
  document.title = `${t("Health")} – wetwell`;
  const bus = html("p", { class: "note" });
  const body = html("tbody");
  main.append(html("div", { class: "tools" }, html("h1", {}, t("Health")), bus),
    html("section", { class: "panel scroll", "aria-label": t("Services") },
      html("table", {}, html("thead", {}, html("tr", {}, ...[t("Station"), t("Service"), t("Is there"), t("Last figures"), t("Figures")].map((word) => html("th", { scope: "col" }, word)))), body)));

  async function load() {
    try {
      const { connected, services } = await (await fetch("/api/health")).json();
      showLink(true);
      say(bus, connected ? t("connected to the bus") : t("no connection to the bus"));
      body.replaceChildren(...services.map(line));
    } catch {
      showLink(false);
    }
  }

  function line({ station, service, is_alive: isAlive, status, age_s: age }) {
    const figures = Object.entries(status?.figures ?? {}).map(([name, value]) => measure(name, value));
    return html("tr", {}, html("td", {}, station === "_site" ? t("all") : station), html("th", { scope: "row" }, serviceWord(service)),
      html("td", { class: isAlive ? "" : "is-gone" }, isAlive ? t("yes") : t("gone")), html("td", {}, ago(age)), html("td", { class: "note" }, figures.join(", ")));
  }

  load();
  const timer = setInterval(() => document.hidden || load(), AGAIN_MS);
  return { end: () => clearInterval(timer) };
}
