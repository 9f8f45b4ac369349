/** Operations on one alarm: acknowledge it, shelve it, bring it back. */

import { tell } from "../api.js";
import { element } from "../dom.js";
import { acknowledge, doneWords, operation, reported } from "../parts/operation.js";
import { may } from "../session.js";

const DURATIONS = [
  ["900", "15 min"],
  ["3600", "1 h"],
  ["28800", "8 h"],
  ["86400", "24 h"],
];

/** Returns `{ node, draw(alarm) }`; `again(sentence)` receives a report, null without an action, and requests the list again. */
export function alarmActions(again) {
  let alarm = null;
  const failure = element("span", { class: "action-failure", role: "alert" });
  const act = (done, send) => (name) => reported(() => send(name), failure, again, () => doneWords(alarm, done));
  const post = (action, bodyOf = () => ({})) => (actor) => tell(["alarms", alarm.id, action], { actor, ...bodyOf() });

  const reason = element("input", { required: "", maxlength: "500", "aria-label": "Why it is shelved", placeholder: "reason" });
  const choices = DURATIONS.map(([value, words]) => element("option", { value }, words));
  const duration = element("select", { "aria-label": "For how long" }, ...choices);
  const hold = () => ({ reason: reason.value.trim(), duration_s: Number(duration.value) });
  const text = element("input", { required: "", maxlength: "500", "aria-label": "Comment", placeholder: "comment" });
  const buttons = [
    [operation("Acknowledge", [], act("acknowledged", (name) => acknowledge(alarm, name))), (now) => !now.is_acknowledged],
    [operation("Reset", [], act("reset", post("reset"))), (now) => now.is_latched && now.is_acknowledged],
    [operation("Shelve", [reason, duration], act("shelved", post("shelve", hold))), (now) => now.shelf === null],
    [operation("Unshelve", [], act("unshelved", post("unshelve"))), (now) => now.shelf !== null],
    [operation("Comment", [text], act("commented", post("comment", () => ({ text: text.value.trim() })))), () => true],
  ];
  const back = operation("Return to service", [], act("back in service", post("return-to-service")));
  return {
    node: element("span", { class: "actions" }, ...[...buttons.map(([button]) => button), back].flatMap(({ nodes }) => nodes), failure),
    draw(now) {
      alarm = now;
      for (const [button, isPossible] of buttons) button.draw(may("act_on_alarms") && isPossible(now));
      back.draw(may("change_measuring") && now.outage !== null);
    },
  };
}
