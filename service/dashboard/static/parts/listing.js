/** Tables; in one with a row for each thing, a row stays the same row for as long as its thing is there. */

import { element, setAttribute, setText } from "../dom.js";

/** A table with its roles, which it keeps where a narrow screen shows it otherwise; `heads` are words, or lists of contents. */
export function tableOf(title, heads, ...rows) {
  const actions = () => element("span", { class: "hidden" }, "Actions");
  const cells = heads.map((head) => element("th", { scope: "col", role: "columnheader" }, ...[head || actions()].flat()));
  const head = element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...cells));
  return element("table", { role: "table", "aria-label": title }, head, element("tbody", { role: "rowgroup" }, ...rows));
}

/**
 * Returns `{ node, draw(things, nothing), fail(sentence), setCurrent(isCurrent) }`; `nothing` is said where there are none.
 *
 * `keyOf(thing)` identifies a thing; `rowOf(thing)` makes `{ nodes, draw(thing) }`.
 */
export function listing(title, heads, nothing, keyOf, rowOf) {
  const table = tableOf(title, heads);
  const empty = element("p", { class: "sentence" });
  const drawRows = keyedRows(table.tBodies[0], keyOf, rowOf);
  table.hidden = empty.hidden = true;
  return {
    node: element("div", {}, empty, table),
    draw(things, words = nothing) {
      table.hidden = things.length === 0;
      empty.hidden = things.length > 0;
      setText(empty, words);
      drawRows(things);
    },
    fail(words) {
      empty.hidden = false;
      setText(empty, words);
    },
    setCurrent: (current) => setAttribute(table, "data-current", String(current)),
  };
}

/** Returns a function that draws things as rows of `body`; the arguments are those of `listing`. */
export function keyedRows(body, keyOf, rowOf) {
  const rows = new Map();
  return (things) => {
    const present = new Set(things.map(keyOf));
    for (const [key, row] of rows) {
      if (present.has(key)) continue;
      for (const node of row.nodes) node.remove();
      rows.delete(key);
    }
    let place = body.firstChild;
    for (const thing of things) {
      const key = keyOf(thing);
      const row = rows.get(key) ?? rows.set(key, rowOf(thing)).get(key);
      for (const node of row.nodes) {
        if (place === node) place = node.nextSibling;
        else body.insertBefore(node, place);
      }
      row.draw(thing);
    }
  };
}

/** A cell under its heading. */
export const listingCell = (head, ...content) => element("td", { role: "cell", "data-head": head }, ...content);

/** The cell that names a row. */
export const listingName = (...content) => element("th", { scope: "row", role: "rowheader" }, ...content);

/** A row of all the width below another one. */
export function rowBelow(heads, ...content) {
  return element("tr", { role: "row", class: "below", hidden: "" }, element("td", { role: "cell", colspan: heads.length }, ...content));
}
