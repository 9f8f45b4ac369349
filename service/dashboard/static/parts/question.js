/** A question below a row before something is done that cannot be taken back; Escape leaves it. */

import { button, element, setText } from "../dom.js";

/** A field of a form with its words. */
export const labelled = (words, field) => element("label", {}, words, field);

/**
 * Returns `{ node, open(opener) }`; `fields` stand before the button that carries `act` out.
 *
 * `act` throws the reason of a failure; `done` is called after a success.
 */
export function question(sentence, words, fields, act, done) {
  const failure = element("span", { class: "action-failure", role: "alert" });
  const send = element("button", { type: "submit" }, words);
  const cancel = button("Cancel", close);
  const node = element("form", { class: "asking question", hidden: "" }, element("strong", {}, sentence), ...fields, send, cancel, failure);
  let opener = null;

  function close() {
    node.hidden = true;
    node.reset();
    if (opener?.isConnected) opener.focus();
  }

  node.addEventListener("submit", async (submitted) => {
    submitted.preventDefault();
    send.disabled = true;
    setText(failure, "");
    try {
      await act();
      close();
      done();
    } catch (error) {
      setText(failure, error.message);
    } finally {
      send.disabled = false;
    }
  });
  node.addEventListener("keydown", (key) => key.key === "Escape" && close());
  return {
    node,
    open(from) {
      opener = from;
      setText(failure, "");
      node.hidden = false;
      (node.querySelector("input, select") ?? send).focus();
    },
  };
}
