// Alarms of one station.

import { alarmList } from "./alarm_list.js";
import { html, panel } from "./dom.js";

export function alarmPanel(station) {
  const list = alarmList({ withStation: false });
  const element = panel("Alarms", html("div", { class: "scroll" }, list.element));
  element.classList.add("is-alarms");
  return {
    element,
    update(changed) {
      if (changed.has("alarms")) list.show([...station.alarms.values()].filter((alarm) => alarm.state !== "normal"));
    },
  };
}
