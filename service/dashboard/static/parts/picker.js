/** A choice of several out of many: boxes to tick, by kind, found by typing a few letters. */

import { element, setText } from "../dom.js";

/**
 * Returns `{ node, offer(groups), choose(values) }`; groups are `[words, [[value, words], …]]`.
 *
 * `onChange(values)` is called with what is ticked, in the order of the list; no more than `most` can be.
 */
export function picker(title, most, onChange) {
  const summary = element("summary");
  const search = element("input", { type: "search", placeholder: "type to find", "aria-label": `Find in ${title.toLowerCase()}` });
  const list = element("div", { class: "picker-list" });
  const note = element("p", { class: "sentence", role: "status" });
  const node = element("details", { class: "picker panel" }, summary, search, note, list);
  let chosen = new Set();
  let boxes = [];

  const values = () => boxes.filter(({ input }) => input.checked).map(({ value }) => value);

  function draw() {
    for (const { input, value } of boxes) input.checked = chosen.has(value);
    const full = chosen.size >= most;
    for (const { input } of boxes) input.disabled = full && !input.checked;
    setText(summary, `${title}: ${chosen.size === 0 ? "none chosen" : chosen.size}`);
    say(full);
  }

  function say(full) {
    const nothing = boxes.length > 0 && boxes.every(({ label }) => label.hidden);
    if (nothing) setText(note, `Nothing here is called “${search.value}”.`);
    else setText(note, full ? `No more than ${most} at a time: take one away first.` : "");
    note.hidden = note.textContent === "";
  }

  search.addEventListener("input", () => {
    const terms = search.value.toLowerCase().split(/\s+/);
    for (const { label, words } of boxes) label.hidden = !terms.every((term) => words.includes(term));
    for (const group of list.children) group.hidden = [...group.querySelectorAll("label")].every((label) => label.hidden);
    say(chosen.size >= most);
  });

  return {
    node,
    offer(groups) {
      boxes = groups.flatMap(([kind, options]) => options.map(([value, words]) => box(kind, value, words)));
      for (const { input } of boxes) {
        input.addEventListener("change", () => {
          chosen = new Set(values());
          draw();
          onChange([...chosen]);
        });
      }
      let next = 0;
      list.replaceChildren(...groups.map(([kind, options]) => {
        const labels = options.map(() => boxes[next++].label);
        return element("fieldset", {}, element("legend", {}, kind), ...labels);
      }));
      draw();
    },
    choose(wanted) {
      chosen = new Set(wanted);
      draw();
    },
  };
}

function box(kind, value, words) {
  const input = element("input", { type: "checkbox", value });
  return { input, value, words: `${kind} ${words}`.toLowerCase(), label: element("label", {}, input, ` ${words}`) };
}
