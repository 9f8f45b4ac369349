/** The open alarms of each unit as one mark, from the alarm list. */

import { isHidden } from "../alarm_words.js";
import { ask } from "../api.js";
import { CURRENT_LIMIT_S, moment, secondsBetween } from "../live.js";
import { poll } from "../poll.js";
import { isAbout } from "./alarm_brief.js";
import { mark } from "./mark.js";

const PERIOD_S = 2;

/** Asks for the list. Returns `{ markOf(unit), close() }`; `markOf` gives `{ node, draw() }`. */
export function unitAlarmMarks() {
  let alarms = null;
  let receivedAt = null;
  const questions = poll(async (signal) => {
    try {
      ({ alarms } = await ask(["alarms"], [], signal));
      receivedAt = moment();
    } catch {
      // the head of the page says that alarms are not known
    }
  }, () => PERIOD_S);
  const isCurrent = () => receivedAt !== null && secondsBetween(receivedAt, moment()) <= CURRENT_LIMIT_S;
  return { markOf: (unit) => unitMark(() => (isCurrent() ? alarms.filter((alarm) => isAbout(alarm, unit)) : null)), close: questions.stop };
}

function unitMark(find) {
  const shown = mark();
  return {
    node: shown.node,
    draw() {
      const open = find()?.filter((alarm) => !isHidden(alarm)) ?? null;
      shown.node.hidden = open !== null && open.length === 0;
      shown.draw(...(open === null ? ["uncertain", "Alarms unknown"] : wordsOf(open)));
    },
  };
}

function wordsOf(open) {
  const danger = open.filter((alarm) => alarm.is_active && alarm.level === "danger").length;
  const returned = open.filter((alarm) => !alarm.is_active).length;
  const look = danger ? "bad" : returned === open.length ? "absent" : "uncertain";
  const parts = [`${open.length} ${open.length === 1 ? "alarm" : "alarms"}`];
  if (danger) parts.push(`${danger} danger`);
  if (returned) parts.push(`${returned} returned`);
  return [look, parts.join(", ")];
}
