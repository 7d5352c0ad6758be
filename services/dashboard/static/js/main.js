// Which page the address names; one is shown at a time.

import { onMove } from "./address.js";
import { alarmsPage } from "./alarms_page.js";
import { healthPage } from "./health_page.js";
import { overviewPage } from "./overview_page.js";
import { reportsPage } from "./reports_page.js";
import { stationPage } from "./station_page.js";
import { startTheme } from "./theme.js";
import { learnWho } from "./who.js";

const PAGES = { "/": overviewPage, "/alarms": alarmsPage, "/reports": reportsPage, "/health": healthPage };

const main = document.getElementById("main");
const link = document.getElementById("link");
let leave = () => {};

function showLink(isThere) {
  link.className = isThere ? "link" : "link lost";
  const text = isThere ? "live" : "connection lost, trying again";
  if (link.textContent !== text) link.textContent = text;
}

function show(isFirst) {
  leave();
  main.replaceChildren();
  const station = location.pathname.match(/^\/station\/([^/]+)$/);
  const page = station ? (...rest) => stationPage(decodeURIComponent(station[1]), ...rest) : (PAGES[location.pathname] ?? overviewPage);
  leave = page(main, showLink) ?? (() => {});
  for (const each of document.querySelectorAll(".bar nav a")) {
    const isHere = each.getAttribute("href") === (station ? "/" : location.pathname);
    if (isHere) each.setAttribute("aria-current", "page");
    else each.removeAttribute("aria-current");
  }
  if (!isFirst) {
    main.focus();
    scrollTo(0, 0);
  }
}

startTheme();
await learnWho();
onMove(() => show(false));
show(true);
