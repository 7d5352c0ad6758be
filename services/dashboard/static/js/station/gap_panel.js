// How far the station is from its simulator, day by day, and what that is called.

import { absence } from "../base/absent.js";
import { chart } from "../base/chart.js";
import { html, panel, say } from "../base/dom.js";
import { figure, millis, moment } from "../base/format.js";
import { t } from "../base/words.js";
import { groupWords, nameWords, signalWords } from "./gap_words.js";

const DAY_S = 86_400;

export function gapPanel({ station }) {
  const away = absence("watch");
  const note = html("p", { class: "empty" }, t("The watch has not looked at a whole day yet."));
  const lead = html("p", { class: "lead" });
  const names = html("ul", { class: "names" });
  let signals = [];
  const matters = chart(t("Gap that matters, day by day"), () => [{ label: t("times what matters"), pen: "pen1", width: 2, points: { show: true } }],
    { unit: t("times what matters"), height: 140, ofDays: true, range: (_, low, high) => [0, Math.max(1.2, high || 0) * 1.1], limits: () => [{ value: 1, word: t("what matters") }] });
  const noise = chart(t("Gap of each signal, day by day"), () => signals.map((name, place) => ({ label: signalWords(name), pen: `pen${(place % 4) + 1}`, width: 1.5, points: { show: true } })),
    { unit: t("in units of noise"), height: 140, ofDays: true, legend: true, range: (_, low, high) => [0.9, Math.max(2, high || 0) * 1.1] });
  const charts = html("div", { class: "pair", hidden: true }, matters.element, noise.element);
  const element = panel(t("Gap to the simulator"), away.element, note, lead, names, charts);
  element.classList.add("is-gap");

  function show(gap) {
    note.hidden = true;
    charts.hidden = false;
    const size = { matters: figure(gap.matters, 2), first: figure(gap.first_matters, 2), group: groupWords(gap.group, (number) => station.called(number)), time: moment(millis(gap.time)) };
    say(lead, `${t("Until {time} the station is {matters} times what matters from its simulator ({group}); it was {first} at the first look.", size)}${gap.is_doubled ? ` ${t("It has doubled.")}` : ""}${gap.refused ? ` ${t("The last day could not be looked at: {why}", { why: gap.refused })}` : ""}`);
    const told = [...gap.called, ...gap.past].map((one) => nameWords(one, (number) => station.called(number)));
    names.replaceChildren(...(told.length ? told : [t("Nothing is called: no effect moves a signal by more than what matters.")]).map((text) => html("li", {}, text)));
    const times = gap.looks.map((look) => millis(look.time) / 1000);
    const [first, last] = [times[0] - DAY_S, times.at(-1) + DAY_S]; // a day of room on both sides
    const framed = (values) => [null, ...values, null];
    matters.update([[first, ...times, last], framed(gap.looks.map((look) => look.matters))]);
    signals = Object.keys(gap.gap);
    noise.update([[first, ...times, last], ...signals.map((name) => framed(gap.looks.map((look) => look.gap[name] ?? null)))]);
  }

  return {
    element,
    update(changed) {
      away.show(station.has("watch"));
      if (station.gap && (changed.has("gap") || changed.has("begin"))) show(station.gap);
    },
    end() {
      matters.end();
      noise.end();
    },
  };
}
