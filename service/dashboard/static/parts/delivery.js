/** Receivers of alarm messages: a line for each receiver that fails or is behind, else nothing. */

import { element } from "../dom.js";
import { formatTime } from "../format.js";
import { mark } from "./mark.js";

/** Returns `{ node, draw(delivery), fail(words) }`. */
export function deliveryView() {
  const list = element("ul", {});
  const node = element("section", { class: "panel delivery", hidden: "" }, element("h2", {}, "Delivery"), list);

  function show(lines) {
    node.hidden = lines.length === 0;
    list.replaceChildren(...lines.map(([look, words]) => {
      const state = mark();
      state.draw(look, words);
      return element("li", {}, state.node);
    }));
  }

  return {
    node,
    draw: ({ receivers }) => show(receivers.filter(isTroubled).map((one) => [lookOf(one), lineWords(one)])),
    fail: (words) => show([["uncertain", `Whether alarms are delivered is not known. ${words}`]]),
  };
}

const isTroubled = (one) => one.n_failures > 0 || one.n_waiting > 0 || one.n_dead > 0 || one.state === "store_fails";

const lookOf = (one) => (one.n_failures > 0 || one.state === "store_fails" ? "bad" : "uncertain");

/** `maximo: not reached since 12:03:05, 7 attempts: Connection refused; 12 messages wait` */
export function lineWords(one) {
  const words = [];
  if (one.n_failures > 0) {
    const attempts = one.n_failures === 1 ? "1 attempt" : `${one.n_failures} attempts`;
    words.push(`not delivered since ${time(one.failing_since)}, ${attempts}: ${one.reason}`);
  }
  if (one.state === "store_fails") words.push("the outbox is out of reach");
  if (one.state === "not_in_the_plant_file") words.push("no longer in the plant file");
  if (one.n_waiting) words.push(`${messages(one.n_waiting, "waits", "wait")} since ${time(one.waiting_since)}${one.state === "quiet" ? " for the end of quiet hours" : ""}`);
  if (one.n_dead) words.push(`${messages(one.n_dead, "was", "were")} never delivered, the last: ${one.last_dead.reason}`);
  return `${one.id}: ${words.join("; ")}`;
}

const messages = (n, verb, verbs) => (n === 1 ? `1 message ${verb}` : `${n} messages ${verbs}`);
const time = (text) => formatTime(Date.parse(text));
