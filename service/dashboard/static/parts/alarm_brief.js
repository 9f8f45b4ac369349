/** Alarms of one unit in a few lines: what is on the list, and how much cannot be judged. */

import { alarmReasonWords, holdWords, isHidden, kindWords, levelMark, placeWords, stateWords, valueWords } from "../alarm_words.js";
import { alarmPlace } from "../alarm_place.js";
import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { poll } from "../poll.js";
import { ALARMS_ADDRESS } from "../route.js";
import { mark } from "./mark.js";

const PERIOD_S = 5;

/** Whether an alarm is about a unit; the service names a unit whose samples got lost as a subject. */
export const isAbout = (alarm, unit) => alarm.unit === unit || (alarm.unit === "plant" && alarm.subject === unit);

/** Returns `{ node, close() }`. */
export function alarmBrief(unit) {
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const list = element("ul", { class: "brief-list" });
  const link = element("a", { class: "more", href: ALARMS_ADDRESS }, "Alarm list");
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Open alarms"), link);
  const questions = poll(async (signal) => {
    try {
      const { alarms, unjudged } = await ask(["alarms"], [], signal);
      const mine = alarms.filter((alarm) => isAbout(alarm, unit));
      const open = mine.filter((alarm) => !isHidden(alarm));
      const n = { open: open.length, hidden: mine.length - open.length, unjudged: unjudged.filter((alarm) => isAbout(alarm, unit)).length };
      list.replaceChildren(...open.map(alarmLine));
      setText(sentence, countSentence(n));
    } catch (failure) {
      if (signal.aborted) return;
      list.replaceChildren();
      setText(sentence, `Alarms are not known now. ${failure.message}`);
    }
  }, () => PERIOD_S);
  return {
    node: element("section", { class: "panel unit-alarms" }, head, list, sentence),
    draw() {},
    close: questions.stop,
  };
}

function countSentence({ open, hidden, unjudged }) {
  const parts = [];
  if (open === 0) parts.push("No open alarm on this unit.");
  if (hidden) parts.push(`${hidden} shelved, suppressed or out of service.`);
  if (unjudged) parts.push(`${unjudged} cannot be judged now.`);
  return parts.join(" ");
}

function alarmLine(alarm) {
  const level = mark();
  level.draw(...levelMark(alarm));
  const since = alarm.raised ? `since ${formatTime(Date.parse(alarm.raised))}` : "";
  const why = alarm.condition === "unknown" ? `condition not known: ${alarmReasonWords(alarm.condition_reason)}` : "";
  const words = [valueWords(alarm), stateWords(alarm.state).toLowerCase(), why, since, holdWords(alarm)].filter(Boolean);
  const what = element("a", { href: alarmPlace(alarm) }, `${placeWords(alarm)}: ${kindWords(alarm.kind)}`);
  return element("li", { "data-alarm": alarm.id }, level.node, what, element("span", {}, words.join(" · ")));
}
