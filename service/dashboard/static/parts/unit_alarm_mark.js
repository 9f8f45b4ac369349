/** The open alarms of the plant, from the alarm list: those of a bearing, and a mark for each unit. */

import { isHidden } from "../alarm_words.js";
import { ask } from "../api.js";
import { CURRENT_LIMIT_S, moment, secondsBetween } from "../live.js";
import { poll } from "../poll.js";
import { isAbout } from "./alarm_brief.js";
import { mark } from "./mark.js";

const PERIOD_S = 2;

/**
 * Asks for the list. Returns `{ of(unit, bearing), markOf(unit), close() }`.
 *
 * `of` gives the open alarms, null if they are not known; `markOf` gives `{ node, draw() }`.
 */
export function openAlarms() {
  let alarms = null;
  let receivedAt = null;
  const questions = poll(async (signal) => {
    ({ alarms } = await ask(["alarms"], [], signal));
    receivedAt = moment();
  }, () => PERIOD_S, () => {}); // the head of the page says that alarms are not known
  function open(isWanted) {
    const isCurrent = receivedAt !== null && secondsBetween(receivedAt, moment()) <= CURRENT_LIMIT_S;
    return isCurrent ? alarms.filter((alarm) => !isHidden(alarm) && isWanted(alarm)) : null;
  }
  return {
    of: (unit, bearing) => open((alarm) => alarm.unit === unit && alarm.subject === bearing),
    markOf: (unit) => unitMark(() => open((alarm) => isAbout(alarm, unit))),
    close: questions.stop,
  };
}

function unitMark(find) {
  const shown = mark();
  return {
    node: shown.node,
    draw() {
      const open = find();
      shown.node.hidden = open?.length === 0;
      if (!shown.node.hidden) shown.draw(...(open === null ? ["uncertain", "Alarms unknown"] : wordsOf(open)));
    },
  };
}

function wordsOf(open) {
  const n = { danger: 0, alert: 0, returned: 0 };
  for (const { is_active: active, level } of open) n[active ? level : "returned"] += 1;
  const parts = Object.entries(n).filter(([, count]) => count > 0);
  return [parts[0][0] === "returned" ? "quiet" : parts[0][0], parts.map(([name, count]) => `${count} ${name === "alert" && count > 1 ? "alerts" : name}`).join(", ")];
}
