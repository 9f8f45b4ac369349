/** What somebody may do to one alarm: acknowledge it, shelve it, bring it back. */

import { tell } from "../api.js";
import { element, setText } from "../dom.js";
import { may } from "../session.js";

const DURATIONS = [
  ["900", "15 min"],
  ["3600", "1 h"],
  ["28800", "8 h"],
  ["86400", "24 h"],
];

/** Returns `{ node, draw(alarm) }`; `again` asks for the list afresh. */
export function alarmActions(actor, again) {
  let alarm = null;
  const failure = element("span", { class: "action-failure", role: "alert" });

  async function act(action, body = {}) {
    const name = actor.name();
    if (name === null) {
      setText(failure, "Give your name first.");
      return false;
    }
    try {
      await tell(["alarms", alarm.id, action], { actor: name, ...body });
      setText(failure, "");
      return true;
    } catch (error) {
      setText(failure, error.message);
      return false;
    } finally {
      again();
    }
  }

  const acknowledge = button("Acknowledge", () => act("acknowledge", { occurrence: alarm.occurrence }));
  const reset = button("Reset", () => act("reset"));
  const unshelve = button("Unshelve", () => act("unshelve"));
  const back = button("Return to service", () => act("return-to-service"));
  const form = shelfForm((body) => act("shelve", body));
  const shelve = button("Shelve…", () => form.open());
  const words = commentForm((body) => act("comment", body));
  const comment = button("Comment…", () => words.open());
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

function shelfForm(submit) {
  const reason = element("input", { required: "", maxlength: "500", "aria-label": "Why it is shelved", placeholder: "why" });
  const choices = DURATIONS.map(([value, words]) => element("option", { value }, words));
  const duration = element("select", { "aria-label": "For how long" }, ...choices);
  const close = button("Cancel", () => (node.hidden = true));
  const send = element("button", { type: "submit" }, "Shelve");
  const node = element("form", { class: "shelf-form", hidden: "" }, reason, duration, send, close);
  node.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (await submit({ reason: reason.value.trim(), duration_s: Number(duration.value) })) {
      node.hidden = true;
      reason.value = "";
    }
  });
  return {
    node,
    open() {
      node.hidden = false;
      reason.focus();
    },
  };
}

function commentForm(submit) {
  const text = element("input", { required: "", maxlength: "500", "aria-label": "Comment", placeholder: "what to remember" });
  const close = button("Cancel", () => (node.hidden = true));
  const send = element("button", { type: "submit" }, "Comment");
  const node = element("form", { class: "shelf-form", hidden: "" }, text, send, close);
  node.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (await submit({ text: text.value.trim() })) {
      node.hidden = true;
      text.value = "";
    }
  });
  return {
    node,
    open() {
      node.hidden = false;
      text.focus();
    },
  };
}

function button(words, onClick) {
  const node = element("button", { type: "button" }, words);
  node.addEventListener("click", onClick);
  return node;
}
