/** Operations on one alarm: acknowledge it, shelve it, bring it back. */

import { kindWords, placeWords } from "../alarm_words.js";
import { tell } from "../api.js";
import { element, setText } from "../dom.js";
import { may } from "../session.js";

const DURATIONS = [
  ["900", "15 min"],
  ["3600", "1 h"],
  ["28800", "8 h"],
  ["86400", "24 h"],
];

const DONE = {
  acknowledge: "acknowledged",
  reset: "reset",
  shelve: "shelved",
  unshelve: "back from the shelf",
  comment: "commented",
  "return-to-service": "back in service",
};

/** Returns `{ node, draw(alarm) }`; `again(sentence)` receives a report, null without an action, and requests the list again. */
export function alarmActions(actor, again) {
  let alarm = null;
  const failure = element("span", { class: "action-failure", role: "alert" });

  async function act(action, body = {}) {
    const name = actor.name();
    if (name === null) {
      setText(failure, "Give your name first.");
      return false;
    }
    const sentence = `${placeWords(alarm)}, ${kindWords(alarm.kind)}: ${DONE[action]}.`;
    try {
      await tell(["alarms", alarm.id, action], { actor: name, ...body });
      setText(failure, "");
      again(sentence);
      return true;
    } catch (error) {
      setText(failure, error.message);
      again(null);
      return false;
    }
  }

  const acknowledge = button("Acknowledge", () => act("acknowledge", { occurrence: alarm.occurrence }));
  const reset = button("Reset", () => act("reset"));
  const unshelve = button("Unshelve", () => act("unshelve"));
  const back = button("Return to service", () => act("return-to-service"));
  const shelve = button("Shelve…", () => form.open());
  const form = shelfForm((body) => act("shelve", body), shelve);
  const comment = button("Comment…", () => words.open());
  const words = commentForm((body) => act("comment", body), comment);
  return {
    node: element("span", { class: "actions" }, acknowledge, reset, shelve, unshelve, back, comment, form.node, words.node, failure),
    draw(now) {
      alarm = now;
      acknowledge.hidden = !actor.may || now.is_acknowledged;
      reset.hidden = !actor.may || !now.is_latched || !now.is_acknowledged;
      unshelve.hidden = !actor.may || now.shelf === null;
      comment.hidden = !actor.may || !words.node.hidden;
      shelve.hidden = !actor.may || now.shelf !== null || !form.node.hidden;
      back.hidden = !may("change_measuring") || now.outage === null;
    },
  };
}

function shelfForm(submit, opener) {
  const reason = element("input", { required: "", maxlength: "500", "aria-label": "Why it is shelved", placeholder: "why" });
  const choices = DURATIONS.map(([value, words]) => element("option", { value }, words));
  const duration = element("select", { "aria-label": "For how long" }, ...choices);
  return foldingForm("Shelve", [reason, duration], opener, () =>
    submit({ reason: reason.value.trim(), duration_s: Number(duration.value) }),
  );
}

function commentForm(submit, opener) {
  const text = element("input", { required: "", maxlength: "500", "aria-label": "Comment", placeholder: "what to remember" });
  return foldingForm("Comment", [text], opener, () => submit({ text: text.value.trim() }));
}

/** A form in place of the button that opens it; the keyboard goes in with it, and back when it closes. */
function foldingForm(words, fields, opener, send) {
  const cancel = button("Cancel", close);
  const node = element("form", { class: "shelf-form", hidden: "" }, ...fields, element("button", { type: "submit" }, words), cancel);
  function close() {
    node.hidden = true;
    opener.hidden = false;
    opener.focus();
  }
  node.addEventListener("keydown", (key) => key.key === "Escape" && close());
  node.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (!(await send())) return;
    fields[0].value = "";
    close();
  });
  return {
    node,
    open() {
      node.hidden = false;
      opener.hidden = true;
      fields[0].focus();
    },
  };
}

function button(words, onClick) {
  const node = element("button", { type: "button" }, words);
  node.addEventListener("click", onClick);
  return node;
}
