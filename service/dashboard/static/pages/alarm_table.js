/** Alarms as a table; a row stays the same row as long as its alarm is there. */

import { conditionWords, holdWords, levelMark, placeWords, raisedWords, stateWords, valueWords, waitWords, whatWords } from "../alarm_words.js";
import { alarmPlace } from "../alarm_place.js";
import { button, element, setAttribute, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { evidenceLinks } from "../parts/evidence.js";
import { listing, listingCell } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { may } from "../session.js";
import { alarmActions } from "./alarm_actions.js";

const HEADS = ["Priority", "State", "Where", "What", "Value", "Condition now", "Since", "Report", ""];

/**
 * Returns `{ node, draw(alarms), setCurrent(isCurrent) }`; `above` stands over the table.
 *
 * `onSelect(id, isSelected)` makes rows selectable; `onCell(alarm)` receives a request for the alarms of the same cell.
 */
export function alarmTable(title, nothing, again, { above = "", onSelect = null, onCell }) {
  const table = listing(title, HEADS, nothing, ({ id }) => id, () => alarmRow(again, onSelect, onCell));
  const node = element("section", { class: "panel alarm-list" }, element("h2", {}, title), above, table.node);
  return { node, draw: table.draw, setCurrent: table.setCurrent };
}

function alarmRow(again, onSelect, onCell) {
  let alarm = null;
  const priority = mark();
  const select = element("input", { type: "checkbox", "aria-label": "Select" });
  select.addEventListener("change", () => onSelect(alarm.id, select.checked));
  const texts = HEADS.slice(1, 7).map((head) => element(head === "Where" ? "a" : "span"));
  const [hold, raisedAt, waits] = [0, 1, 2].map(() => element("span", { class: "hold" }));
  const cell = button("Same cell", () => onCell(alarm), { class: "same-cell", title: "Show alarms raised in the same condition cell" });
  const evidence = evidenceLinks();
  const actions = alarmActions(again);
  const cells = [priority.node, ...texts, evidence.node, actions.node].map((content, n) => listingCell(HEADS[n], content));
  cells[0].prepend(select);
  cells[1].append(hold);
  cells[5].append(waits);
  cells[6].append(raisedAt, cell);
  const node = element("tr", { role: "row" }, ...cells);
  return {
    nodes: [node],
    draw(now) {
      alarm = now;
      setAttribute(node, "data-alarm", alarm.id);
      setAttribute(node, "data-state", alarm.state);
      priority.draw(...levelMark(alarm));
      select.hidden = onSelect === null || alarm.is_acknowledged || !may("act_on_alarms");
      const words = [
        stateWords(alarm.state) + (alarm.is_latched ? ", latched" : "") + (alarm.is_chattering ? ", chattering" : ""),
        placeWords(alarm),
        whatWords(alarm),
        valueWords(alarm),
        conditionWords(alarm),
        alarm.raised ? formatTime(Date.parse(alarm.raised)) : "",
      ];
      texts.forEach((text, index) => setText(text, words[index]));
      setAttribute(texts[HEADS.indexOf("Where") - 1], "href", alarmPlace(alarm));
      setText(hold, holdWords(alarm));
      setText(waits, waitWords(alarm));
      setText(raisedAt, raisedWords(alarm));
      cell.hidden = !alarm.raised_at?.cell;
      evidence.draw(alarm.id, alarm.occurrence);
      actions.draw(alarm);
    },
  };
}
