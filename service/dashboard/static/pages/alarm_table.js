/** Alarms as a table; a row stays the same row as long as its alarm is there. */

import { conditionWords, holdWords, kindWords, levelMark, placeWords, raisedWords, stateWords, valueWords } from "../alarm_words.js";
import { alarmPlace } from "../alarm_place.js";
import { element, setAttribute, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { evidenceLinks } from "../parts/evidence.js";
import { mark } from "../parts/mark.js";
import { alarmActions } from "./alarm_actions.js";

const HEADS = ["Priority", "State", "Where", "What", "Value", "Condition now", "Since", ""];

/** Returns `{ node, draw(alarms), setCurrent(isCurrent) }`. */
export function alarmTable(title, nothing, actor, again) {
  const body = element("tbody", { role: "rowgroup" });
  const empty = element("p", { class: "sentence" }, nothing);
  const heads = HEADS.map((head) => element("th", { scope: "col", role: "columnheader" }, head || element("span", { class: "hidden" }, "Actions")));
  const table = element(
    "table",
    { role: "table", "aria-label": title, hidden: "" },
    element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...heads)),
    body,
  );
  const rows = new Map();
  return {
    node: element("section", { class: "panel alarm-list" }, element("h2", {}, title), empty, table),
    draw(alarms) {
      table.hidden = alarms.length === 0;
      empty.hidden = alarms.length > 0;
      const present = new Set(alarms.map((alarm) => alarm.id));
      for (const [id, row] of rows) {
        if (!present.has(id)) {
          row.node.remove();
          rows.delete(id);
        }
      }
      alarms.forEach((alarm, place) => {
        const row = rows.get(alarm.id) ?? rows.set(alarm.id, alarmRow(actor, again)).get(alarm.id);
        if (body.children[place] !== row.node) body.insertBefore(row.node, body.children[place] ?? null);
        row.draw(alarm);
      });
    },
    setCurrent(isCurrent) {
      setAttribute(table, "data-current", String(isCurrent));
    },
  };
}

function alarmRow(actor, again) {
  const priority = mark();
  const texts = HEADS.slice(1, -1).map((head) => element(head === "Where" ? "a" : "span"));
  const hold = element("span", { class: "hold" });
  const raisedAt = element("span", { class: "hold" });
  const actions = alarmActions(actor, again);
  const cells = [priority.node, ...texts, actions.node].map((node, index) =>
    element("td", { role: "cell", "data-head": HEADS[index] }, node),
  );
  const evidence = evidenceLinks();
  cells[1].append(hold);
  cells[6].append(raisedAt, evidence.node);
  const node = element("tr", { role: "row" }, ...cells);
  return {
    node,
    draw(alarm) {
      setAttribute(node, "data-alarm", alarm.id);
      setAttribute(node, "data-state", alarm.state);
      priority.draw(...levelMark(alarm));
      const words = [
        stateWords(alarm.state) + (alarm.is_latched ? ", latched" : "") + (alarm.is_chattering ? ", chattering" : ""),
        placeWords(alarm),
        kindWords(alarm.kind),
        valueWords(alarm),
        conditionWords(alarm),
        alarm.raised ? formatTime(Date.parse(alarm.raised)) : "",
      ];
      texts.forEach((text, index) => setText(text, words[index]));
      setAttribute(texts[HEADS.indexOf("Where") - 1], "href", alarmPlace(alarm));
      setText(hold, holdWords(alarm));
      setText(raisedAt, raisedWords(alarm));
      evidence.draw(alarm.id, alarm.occurrence);
      actions.draw(alarm);
    },
  };
}
