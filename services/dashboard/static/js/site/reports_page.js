// Reports that lie in the folder of the settings.

import { html, say } from "../base/dom.js";
import { moment, zone } from "../base/format.js";
import { t } from "../base/words.js";

export function reportsPage(main, showLink) {
  document.title = `${t("Reports")} – wetwell`;
  const note = html("p", { class: "empty" });
  const body = html("tbody");
  const table = html("table", { hidden: true }, html("thead", {}, html("tr", {}, html("th", { scope: "col" }, t("Report")), html("th", { scope: "col" }, t("Written, {zone}", { zone: zone() })))), body);
  main.append(html("div", { class: "tools" }, html("h1", {}, t("Reports"))), html("section", { class: "panel", "aria-label": t("Reports") }, note, table));
  fetch("/api/reports").then((answer) => answer.json()).then(({ reports, reason }) => {
    showLink(true);
    say(note, reason);
    table.hidden = !reports.length;
    body.replaceChildren(...reports.map(({ name, time }) =>
      html("tr", {}, html("td", {}, html("a", { href: `/reports/${name.split("/").map(encodeURIComponent).join("/")}`, target: "_blank", rel: "noopener" }, name)), html("td", {}, moment(Date.parse(time))))));
  }).catch(() => showLink(false));
}
