/** One entry of the audit trail. */

import { actionWords, actorWords, changeLines, objectWords, throughWords } from "../audit_words.js";
import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { listingCell, listingName } from "../parts/listing.js";

export const AUDIT_HEADS = ["No.", "Time", "Who", "What", "To what", "Before → after", "Why", "Through"];

/** Returns `{ nodes, draw() }`; an entry never changes. */
export function auditRow(entry) {
  const changes = changeLines(entry).map((line) => element("li", {}, line));
  const contents = [
    formatTime(Date.parse(entry.time)),
    actorWords(entry),
    actionWords(entry.action),
    objectWords(entry),
    changes.length ? element("ul", { class: "changes" }, ...changes) : "",
    entry.reason,
    throughWords(entry),
  ];
  const cells = contents.map((content, n) => listingCell(AUDIT_HEADS[n + 1], content));
  const name = listingName(String(entry.number));
  name.title = `Chain ${entry.chain}, hash ${entry.hash}`;
  return { nodes: [element("tr", { role: "row", "data-entry": `${entry.chain} ${entry.number}` }, name, ...cells)], draw() {} };
}
