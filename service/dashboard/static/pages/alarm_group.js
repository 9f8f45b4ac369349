/** Acknowledgement of several alarms at once: those that are selected, or all that are shown. */

import { placeWords } from "../alarm_words.js";
import { element, setText } from "../dom.js";
import { acknowledge, operation } from "../parts/operation.js";
import { may } from "../session.js";

/** Returns `{ node, draw(shown, selected) }`: the alarms of the list, and the ids of the selected ones. */
export function groupAcknowledge(again) {
  let wanted = [];
  const failure = element("span", { class: "action-failure", role: "alert" });
  const button = operation("Acknowledge", [], async (name) => {
    const refused = [];
    const alarms = wanted; // the occurrences that are on the screen now
    for (const alarm of alarms) {
      try {
        await acknowledge(alarm, name);
      } catch (error) {
        refused.push(`${placeWords(alarm)}: ${error.message}.`);
      }
    }
    setText(failure, refused.join(" "));
    again(`${alarms.length - refused.length} of ${alarms.length} acknowledged.`);
    return refused.length === 0;
  });
  return {
    node: element("div", { class: "actions" }, ...button.nodes, failure),
    draw(shown, selected) {
      const open = shown.filter((alarm) => !alarm.is_acknowledged);
      const chosen = open.filter(({ id }) => selected.has(id));
      wanted = chosen.length ? chosen : open;
      setText(button.opener, chosen.length ? `Acknowledge ${chosen.length} selected` : `Acknowledge all ${open.length} shown`);
      button.draw(may("act_on_alarms") && open.length > 1);
    },
  };
}
