/** Open alarms in a few lines, with the button that acknowledges: of the plant, of a unit, of a bearing. */

import { alarmReasonWords, holdWords, isHidden, kindWords, levelMark, placeWords, stateWords, valueWords, waitWords, whatWords } from "../alarm_words.js";
import { alarmPlace } from "../alarm_place.js";
import { ask } from "../api.js";
import { element, keepingFocus, setAttribute, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { poll } from "../poll.js";
import { ALARMS_ADDRESS } from "../route.js";
import { keyedRows } from "./listing.js";
import { mark } from "./mark.js";
import { acknowledgeButton } from "./operation.js";

const PERIOD_S = 5;

/** Most alarms on the overview; the link leads to the others. */
const MOST = 5;

/** Whether an alarm is about a unit; the service names a unit whose samples got lost as a subject. */
export const isAbout = (alarm, unit) => alarm.unit === unit || (alarm.unit === "plant" && alarm.subject === unit);

/** All alarms of a unit, and how many of them are hidden or cannot be judged. Returns `{ node, draw(), close() }`. */
export const unitAlarms = (unit) => alarmBrief("Open alarms", (alarm) => isAbout(alarm, unit), countSentence);

/** Alarms of a bearing; nothing where there are none. */
export const bearingAlarms = (unit, bearing) => alarmBrief("Open alarms", (alarm) => alarm.unit === unit && alarm.subject === bearing);

/** The unacknowledged alarms of the plant, by name only; hidden if there are none. */
export const alarmsToAcknowledge = () => alarmBrief("Unacknowledged", (alarm) => !alarm.is_acknowledged, null, true);

function alarmBrief(title, isMine, sentenceOf = null, isShort = false) {
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const list = element("ul", { class: "brief-list" });
  const link = element("a", { class: "more", href: ALARMS_ADDRESS }, "Alarm list");
  const head = element("div", { class: "panel-head" }, element("h2", {}, title), link);
  const node = element("section", { class: "panel unit-alarms" }, head, list, sentence);
  const drawRows = keyedRows(list, ({ id }) => id, () => alarmLine((done) => questions.again(done), isShort));
  node.hidden = sentenceOf === null;
  const questions = poll(async (signal) => {
    const { alarms, unjudged } = await ask(["alarms"], [], signal);
    const mine = alarms.filter(isMine);
    const open = mine.filter((alarm) => !isHidden(alarm));
    const shown = sentenceOf ? open : open.slice(0, MOST);
    const n = { open: open.length, hidden: mine.length - open.length, unjudged: unjudged.filter(isMine).length };
    keepingFocus(link, () => drawRows(shown));
    setText(link, shown.length < open.length ? `Alarm list (${open.length - shown.length} more)` : isShort ? "" : "Alarm list");
    link.hidden = link.textContent === "";
    setText(sentence, sentenceOf?.(n) ?? "");
    node.hidden = sentenceOf === null && open.length === 0;
  }, () => PERIOD_S, (failure) => {
    drawRows([]);
    setText(sentence, `Alarms are not known now. ${failure.message}`);
  });
  return { node, draw() {}, close: questions.stop };
}

function countSentence({ open, hidden, unjudged }) {
  const parts = [];
  if (open === 0) parts.push("No open alarm on this unit.");
  if (hidden) parts.push(`${hidden} shelved, suppressed or out of service.`);
  if (unjudged) parts.push(`${unjudged} cannot be evaluated now.`);
  return parts.join(" ");
}

function alarmLine(again, isShort) {
  const level = mark();
  const what = element("a");
  const about = element("span");
  const acknowledge = acknowledgeButton(again);
  const node = element("li", {}, level.node, what, about, acknowledge.node);
  return {
    nodes: [node],
    draw(alarm) {
      setAttribute(node, "data-alarm", alarm.id);
      level.draw(...levelMark(alarm));
      setAttribute(what, "href", alarmPlace(alarm));
      setText(what, `${placeWords(alarm)}: ${isShort ? kindWords(alarm.kind) : whatWords(alarm)}`);
      const since = alarm.raised ? `since ${formatTime(Date.parse(alarm.raised))}` : "";
      const why = alarm.condition === "unknown" ? `cannot be evaluated: ${alarmReasonWords(alarm.condition_reason)}` : "";
      const words = [valueWords(alarm), stateWords(alarm.state).toLowerCase(), why, waitWords(alarm), since, holdWords(alarm)];
      setText(about, isShort ? "" : words.filter(Boolean).join(" · "));
      acknowledge.draw(alarm);
    },
  };
}
