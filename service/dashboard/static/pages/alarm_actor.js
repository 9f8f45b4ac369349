/** Who sits here: there is no login yet, so that a name must be given before anything is done. */

import { element } from "../dom.js";

const KEY = "padwatch-actor";

/** Returns `{ node, name() }`; the name is asked for where it is missing, and then null. `hint`: when it is needed. */
export function actorField(hint = "before you acknowledge") {
  const input = element("input", { id: "actor", maxlength: "80", autocomplete: "name", placeholder: hint });
  input.value = remembered();
  input.addEventListener("change", () => remember(input.value.trim()));
  return {
    node: element("label", { class: "actor", for: "actor" }, "Your name ", input),
    name() {
      const name = input.value.trim();
      if (!name) input.focus();
      return name || null;
    },
  };
}

function remembered() {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return ""; // a browser that keeps nothing asks again
  }
}

function remember(name) {
  try {
    localStorage.setItem(KEY, name);
  } catch {
    // it is asked for again next time
  }
}
