/** In whose name something is done: who is logged in; where no login is needed, a name is asked for once. */

import { button, element, setText } from "../dom.js";
import { keep, read } from "../kept.js";
import { limitSentence, may, session } from "../session.js";

const KEY = "padwatch-actor";

/** The name of the login, or the one given in this session of the browser; null without one. */
export const actorName = () => session()?.name ?? given();

/** A field of a form, present while no name is known. Returns `{ node, draw(), take() }`; `take` returns the name. */
export function nameField() {
  const input = element("input", { maxlength: "80", autocomplete: "name", required: "" });
  const node = element("label", {}, "Your name ", input);
  return {
    node,
    draw() {
      node.hidden = input.disabled = actorName() !== null;
    },
    take() {
      if (!input.disabled) remember(input.value.trim());
      return actorName();
    },
  };
}

/** Whether `permission` is given to do `what`, and in whose name. Returns `{ node, may, draw() }`. */
export function actorField(permission, what) {
  if (!may(permission)) {
    return { node: element("p", { class: "actor limit" }, limitSentence(permission, what)), may: false, draw() {} };
  }
  const words = element("span");
  const other = button("Not you?", () => {
    remember("");
    draw();
  });
  const node = element("span", { class: "actor", hidden: "" }, words, " ", other);
  function draw() {
    node.hidden = Boolean(session()?.name) || given() === null;
    setText(words, `You act as ${given()}.`);
  }
  draw();
  return { node, may: true, draw };
}

let typed = ""; // of a browser that keeps nothing

const given = () => read(KEY, "sessionStorage") || typed || null;

function remember(name) {
  typed = name;
  keep(KEY, name, "sessionStorage");
}
