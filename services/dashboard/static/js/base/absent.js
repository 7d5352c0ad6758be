// A service that is not there is said where its content would be.

import { html } from "./dom.js";
import { words } from "./format.js";
import { t } from "./words.js";

const SAYS = {
  detector: t("The detector is not running: nobody judges this station now. What stands here is what it said last."),
  historian: t("The historian is not running: nothing of the past can be shown, and nothing is kept."),
  alarms: t("The alarm service is not running: no alarm is raised, and an empty list means nothing."),
  watch: t("The watch of the gap is not running: nobody compares this station with its simulator now."),
  source: t("No samples come: what stands here is old. See the alarms, and check PLC, gateway and network."),
};

const NAMES = {
  alarms: t("alarm service"), dashboard: t("dashboard"), detector: t("detector"), fleet: t("fleet"), gateway: t("gateway"), historian: t("historian"),
  router: t("router"), simulator: t("simulator"), watch: t("watch of the gap"),
};

/** What people call a service. */
export const serviceWord = (name) => NAMES[name] ?? words(name);

/** A line that is seen only while a service is away. */
export function absence(service) {
  const element = html("p", { class: "absent", role: "status", "data-service": service, hidden: true }, SAYS[service]);
  return { element, show: (isThere) => { if (element.hidden !== isThere) element.hidden = isThere; } };
}
