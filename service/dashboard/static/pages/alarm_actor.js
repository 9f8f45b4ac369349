/** In whose name something is done: who is logged in; where no login is needed, a name is asked for. */

import { element } from "../dom.js";
import { limitSentence, may, session } from "../session.js";

const KEY = "padwatch-actor";

/**
 * Returns `{ node, name(), may }`; the name is asked for where it is missing, and then null.
 *
 * `permission` and `what` it permits to whom; `hint`: when a name is needed.
 */
export function actorField(permission, what, hint) {
  if (!may(permission)) {
    return { node: element("p", { class: "actor limit" }, limitSentence(permission, what)), name: () => null, may: false };
  }
  const known = session()?.name ?? null;
  if (known !== null) return { node: element("span", { hidden: "" }), name: () => known, may: true };
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
    may: true,
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
