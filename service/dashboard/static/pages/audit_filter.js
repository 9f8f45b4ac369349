/** Which entries of the audit trail are wanted. */

import { actionWords } from "../audit_words.js";
import { element } from "../dom.js";

let nFilters = 0;

/** Returns `{ node, query(), offer(entries) }`; `onAsk` is called when the filter is submitted. */
export function auditFilter(onAsk) {
  const id = `audit-filter-${(nFilters += 1)}`;
  const actors = element("datalist", { id: `${id}-actors` });
  const objects = element("datalist", { id: `${id}-objects` });
  const actor = element("input", { maxlength: "300", list: actors.id, placeholder: "any actor" });
  const object = element("input", { maxlength: "300", list: objects.id, placeholder: "anything" });
  const action = element("select", {}, element("option", { value: "" }, "everything"));
  const [from, until] = ["start", "end"].map(() => element("input", { type: "datetime-local" }));
  const labels = [["Who", actor], ["What", action], ["To what", object], ["From", from], ["Until", until]];
  const look = element("button", { type: "submit" }, "Look");
  const clear = element("button", { type: "reset" }, "Clear");
  const fields = labels.map(([words, field]) => element("label", {}, words, field));
  const node = element("form", { class: "asking", role: "search", "aria-label": "Audit trail" }, ...fields, look, clear, actors, objects);
  const seen = { actor: new Set(), object: new Set(), action: new Set() };

  node.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    onAsk();
  });
  node.addEventListener("reset", () => setTimeout(onAsk)); // the fields are empty only after the event
  return {
    node,
    query() {
      const given = { actor: actor.value.trim(), action: action.value, object: object.value.trim(), start: instant(from.value), end: instant(until.value) };
      return Object.entries(given).filter(([, value]) => value !== "");
    },
    /** What is on the page can be chosen. */
    offer(entries) {
      for (const entry of entries) for (const name of Object.keys(seen)) if (entry[name]) seen[name].add(entry[name]);
      fill(actors, seen.actor);
      fill(objects, seen.object);
      for (const code of seen.action) {
        if (![...action.options].some(({ value }) => value === code)) action.append(element("option", { value: code }, actionWords(code)));
      }
    },
  };
}

function fill(list, values) {
  while (list.childElementCount > values.size) list.lastChild.remove();
  [...values].forEach((value, n) => {
    const option = list.children[n] ?? list.appendChild(element("option"));
    if (option.value !== value) option.value = value;
  });
}

const instant = (local) => (local === "" ? "" : new Date(local).toISOString());
