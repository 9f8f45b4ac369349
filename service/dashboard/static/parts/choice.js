/** One choice of a few, as native radio buttons: arrow keys and screen readers work by themselves. */

import { element } from "../dom.js";

let nGroups = 0;

/** `options` are pairs of value and words. Returns `{ node, value(), words() }`. */
export function choice(legend, options, chosen, onChange) {
  const group = `choice-${(nGroups += 1)}`;
  const node = element("fieldset", { class: "choice" }, element("legend", {}, legend));
  let current = chosen;
  for (const [value, words] of options) {
    const input = element("input", { type: "radio", name: group, value: String(value) });
    input.checked = value === chosen;
    input.addEventListener("change", () => {
      current = value;
      onChange();
    });
    node.append(element("label", {}, input, element("span", {}, words)));
  }
  return { node, value: () => current, words: () => options.find(([value]) => value === current)[1] };
}
