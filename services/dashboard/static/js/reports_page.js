// Reports that lie in the folder of the settings.

import { html, say } from "./dom.js";

export function reportsPage(main, showLink) {
  document.title = "Reports – wetwell";
  const note = html("p", { class: "empty" });
  const body = html("tbody");
  const table = html("table", { hidden: true }, html("thead", {}, html("tr", {}, html("th", { scope: "col" }, "Report"), html("th", { scope: "col" }, "Written, UTC"))), body);
  main.append(html("div", { class: "tools" }, html("h1", {}, "Reports")), html("section", { class: "panel", "aria-label": "Reports" }, note, table));
  fetch("/api/reports").then((answer) => answer.json()).then(({ reports, reason }) => {
    showLink(true);
    say(note, reason);
    table.hidden = !reports.length;
    body.replaceChildren(...reports.map(({ name, time }) =>
      html("tr", {}, html("td", {}, html("a", { href: `/reports/${name.split("/").map(encodeURIComponent).join("/")}`, target: "_blank", rel: "noopener" }, name)), html("td", {}, time.slice(0, 19).replace("T", " ")))));
  }).catch(() => showLink(false));
}
