/** The newest events of all alarms, one line each. */

import { alarmReasonWords, changeWords, placeWords, raisedWords, valueWords, whatWords } from "../alarm_words.js";
import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { evidenceLinks } from "../parts/evidence.js";
import { listing, listingCell } from "../parts/listing.js";

const HEADS = ["Time", "Where", "What", "Change", "Value", "Raised at", "By", "Reason"];

/** Returns `{ node, draw({ events }), fail(sentence) }`; `filter` says which events are wanted. */
export function historyTable(filter) {
  const table = listing("History", HEADS, "", ({ id }) => id, eventRow);
  return {
    node: element("section", { class: "panel alarm-list" }, element("h2", {}, "History"), table.node),
    draw: ({ events }) => table.draw(events, filter.eventQuery().length ? "No event matches the filter." : "Nothing has happened yet."),
    fail: (words) => table.fail(`The history cannot be read: ${words}`),
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
  const row = cells.map((words, index) => listingCell(HEADS[index], words));
  if (["raised", "escalated"].includes(event.change)) {
    const evidence = evidenceLinks();
    evidence.draw(event.alarm, event.occurrence);
    row[HEADS.indexOf("Time")].append(evidence.node);
  }
  return { nodes: [element("tr", { role: "row", "data-event": String(event.id) }, ...row)], draw() {} }; // events never change
}
