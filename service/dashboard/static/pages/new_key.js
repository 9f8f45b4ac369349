/** A key that has just been made, this once: to be copied now, since it is not shown again. */

import { button, element, setText } from "../dom.js";

/** Returns `{ node, show(key) }`. */
export function newKey() {
  const words = element("strong");
  const key = element("input", { readonly: "", "aria-label": "The new key", spellcheck: "false" });
  const copy = button("Copy", async () => setText(said, (await copied(key)) ? "Copied." : "Press Ctrl+C to copy."));
  const done = button("Done", () => {
    node.hidden = true;
    key.value = "";
  });
  const said = element("span", { role: "status" });
  const node = element("div", { class: "asking new-key", hidden: "" }, words, key, copy, done, said);
  key.addEventListener("focus", () => key.select());
  return {
    node,
    show(made) {
      setText(words, `The key of ${made.name}. It is shown this once: copy it now, and keep it like a password.`);
      setText(said, "");
      key.value = made.key;
      node.hidden = false;
      // The form that made it gives the focus back to its button first.
      setTimeout(() => key.focus());
    },
  };
}

/** Whether the browser let us copy; without TLS many do not. */
async function copied(field) {
  field.select();
  try {
    await navigator.clipboard.writeText(field.value);
    return true;
  } catch {
    return false;
  }
}
