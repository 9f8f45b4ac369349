/** The audit trail: who did what to what, before and after, newest first. */

import { ask } from "../api.js";
import { chainWords } from "../audit_words.js";
import { button, element, setText } from "../dom.js";
import { listing } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { auditFilter } from "./audit_filter.js";
import { AUDIT_HEADS, auditRow } from "./audit_row.js";

const PAGE = "100";

/** Returns `{ draw(view), close() }`; asks only when told to, so that what is being read stays still. */
export function auditPage(main) {
  const chain = mark();
  const sentence = element("p", { class: "sentence", role: "status" });
  const table = listing("Audit trail, the newest first", AUDIT_HEADS, "No entry fits.", ({ chain, number }) => `${chain} ${number}`, auditRow);
  const older = button("Older entries", () => look(nextBefore), { hidden: "" });
  const filter = auditFilter(() => look());
  const head = element("div", { class: "page-head" }, element("h1", {}, "Audit trail"), chain.node);
  main.append(head, filter.node, element("section", { class: "panel listing audit" }, sentence, table.node, older));
  let entries = [];
  let nextBefore = null;
  let question = new AbortController();

  async function look(before = null) {
    question.abort();
    const mine = (question = new AbortController());
    setText(sentence, "Asking the service.");
    try {
      const query = [...filter.query(), ["limit", PAGE], ...(before === null ? [] : [["before", before]])];
      show(await ask(["audit"], query, mine.signal), before);
    } catch (failure) {
      if (!mine.signal.aborted) setText(sentence, `The audit trail cannot be read now. ${failure.message}`);
    }
  }

  function show(found, before) {
    entries = before === null ? found.entries : [...entries, ...found.entries];
    nextBefore = found.next_before;
    older.hidden = nextBefore === null;
    filter.offer(entries);
    table.draw(entries);
    const { look: shape, words } = chainWords(entries);
    chain.draw(found.head_error ? "uncertain" : shape, found.head_error ? `The file with the newest hash cannot be written: ${found.head_error}` : words);
    setText(sentence, "");
  }

  chain.draw("absent", "Not read yet");
  look();
  return { draw() {}, close: () => question.abort() };
}
