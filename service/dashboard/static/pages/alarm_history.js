/** The newest events of all alarms, one line each. */

import { alarmReasonWords, changeWords, placeWords, raisedWords, valueWords, whatWords } from "../alarm_words.js";
import { element, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { evidenceLinks } from "../parts/evidence.js";

const HEADS = ["Time", "Where", "What", "Change", "Value", "Raised at", "By", "Reason"];

/** Returns `{ node, draw({ events }), fail(sentence) }`; `filter` says which events are wanted. */
export function historyTable(filter) {
  const heads = HEADS.map((head) => element("th", { scope: "col", role: "columnheader" }, head));
  const body = element("tbody", { role: "rowgroup" });
  const sentence = element("p", { class: "sentence" }, "Nothing has happened yet.");
  const table = element(
    "table",
    { role: "table", "aria-label": "History", hidden: "" },
    element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...heads)),
    body,
  );
  let shown = null;
  return {
    node: element("section", { class: "panel alarm-list" }, element("h2", {}, "History"), sentence, table),
    draw({ events }) {
      table.hidden = events.length === 0;
      sentence.hidden = events.length > 0;
      setText(sentence, filter.eventQuery().length ? "No event matches the filter." : "Nothing has happened yet.");
      const ids = events.map(({ id }) => id).join();
      if (ids === shown) return; // events never change
      shown = ids;
      body.replaceChildren(...events.map(eventRow));
    },
    fail(words) {
      sentence.hidden = false;
      setText(sentence, `The history cannot be read: ${words}`);
    },
  };
}

function eventRow(event) {
  const cells = [
    formatTime(Date.parse(event.time)),
    placeWords(event),
    whatWords(event),
    changeWords(event.change) + (event.change === "raised" && event.level === "danger" ? " as danger" : ""),
    valueWords(event),
    raisedWords(event),
    event.actor,
    event.actor ? event.reason : alarmReasonWords(event.reason),
  ];
  const row = cells.map((words, index) => element("td", { role: "cell", "data-head": HEADS[index] }, words));
  if (["raised", "escalated"].includes(event.change)) {
    const evidence = evidenceLinks();
    evidence.draw(event.alarm, event.occurrence);
    row[HEADS.indexOf("Time")].append(evidence.node);
  }
  return element("tr", { role: "row", "data-event": String(event.id) }, ...row);
}
