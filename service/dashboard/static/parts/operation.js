/** Buttons for operations on alarms; where a name or a reason is needed, a form unfolds in their place. */

import { placeWords, whatWords } from "../alarm_words.js";
import { tell } from "../api.js";
import { button, element, setText } from "../dom.js";
import { may } from "../session.js";
import { actorName, nameField } from "./actor.js";

/**
 * Returns `{ nodes, opener, draw(isPossible) }`; `fields` are asked for before `act(name)`.
 *
 * `act` returns whether the operation was done. The name is asked for where it is not known yet.
 */
export function operation(words, fields, act) {
  const opener = element("button", { type: "button" }, words + (fields.length ? "…" : ""));
  const who = nameField();
  const cancel = button("Cancel", close);
  const send = element("button", { type: "submit" }, words);
  const form = element("form", { class: "shelf-form", hidden: "" }, who.node, ...fields, send, cancel);

  function close() {
    form.hidden = true;
    opener.hidden = false;
    opener.focus();
  }
  opener.addEventListener("click", () => {
    who.draw();
    if (fields.length === 0 && who.node.hidden) return act(actorName());
    form.hidden = false;
    opener.hidden = true;
    form.querySelector("input:enabled, select").focus();
  });
  form.addEventListener("keydown", (key) => key.key === "Escape" && close());
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (!(await act(who.take()))) return who.draw();
    form.reset();
    close();
  });
  return {
    nodes: [opener, form],
    opener,
    draw(isPossible) {
      if (!isPossible) form.hidden = true;
      opener.hidden = !isPossible || !form.hidden;
    },
  };
}

export const acknowledge = (alarm, actor) => tell(["alarms", alarm.id, "acknowledge"], { actor, occurrence: alarm.occurrence });

/** The button that acknowledges an alarm. Returns `{ node, draw(alarm) }`; `again(sentence)` receives a report, null without one. */
export function acknowledgeButton(again) {
  let alarm = null;
  const failure = element("span", { class: "action-failure", role: "alert" });
  const acknowledging = operation("Acknowledge", [], (name) => reported(() => acknowledge(alarm, name), failure, again, () => doneWords(alarm, "acknowledged")));
  return {
    node: element("span", { class: "actions" }, ...acknowledging.nodes, failure),
    draw(now) {
      alarm = now;
      acknowledging.draw(may("act_on_alarms") && !now.is_acknowledged);
    },
  };
}

export const doneWords = (alarm, done) => `${placeWords(alarm)}, ${whatWords(alarm)}: ${done}.`;

/** Carry an operation out; whether it was done. Why it was not stands in `failure` until the next attempt. */
export async function reported(act, failure, again, words) {
  const sentence = words();
  try {
    await act();
  } catch (error) {
    setText(failure, error.message);
    again(null);
    return false;
  }
  setText(failure, "");
  again(sentence);
  return true;
}
