// Which page the address names; one is shown at a time.

import { alarmsPage } from "./alarms/alarms_page.js";
import { onMove } from "./base/address.js";
import { startZone } from "./base/format.js";
import { startTheme } from "./base/theme.js";
import { learnWho } from "./base/who.js";
import { startLanguage, t, translateShell } from "./base/words.js";
import { overviewPage } from "./overview/overview_page.js";
import { healthPage } from "./site/health_page.js";
import { reportsPage } from "./site/reports_page.js";
import { stationPage } from "./station/station_page.js";

const PAGES = { "/": overviewPage, "/alarms": alarmsPage, "/reports": reportsPage, "/health": healthPage };

const main = document.getElementById("main");
const link = document.getElementById("link");
let shown = { path: "", end: () => {} };

function showLink(isThere) {
  link.className = isThere ? "link" : "link lost";
  const text = isThere ? t("live") : t("connection lost, trying again");
  if (link.textContent !== text) link.textContent = text;
}

function show(isFirst) {
  if (shown.path === location.pathname && shown.move) {
    shown.move();
    return;
  }
  shown.end();
  main.replaceChildren();
  const station = location.pathname.match(/^\/station\/([^/]+)$/);
  const page = station ? (...rest) => stationPage(decodeURIComponent(station[1]), ...rest) : (PAGES[location.pathname] ?? overviewPage);
  const made = page(main, showLink) ?? {};
  shown = { path: location.pathname, end: made.end ?? (() => {}), move: made.move };
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

translateShell();
startTheme();
startZone();
startLanguage();
await learnWho();
onMove(() => show(false));
show(true);
