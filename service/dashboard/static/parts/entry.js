/** Forms at the door: labelled fields, one button, and a sentence when something is wrong. */

import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";

/** One field with its label. Returns `{ node, value(), empty(), focus() }`. */
export function entry(label, attributes) {
  const input = element("input", { required: "", ...attributes });
  return {
    node: element("label", {}, element("span", {}, label), input),
    value: () => input.value,
    empty: () => {
      input.value = "";
      input.focus();
    },
    focus: () => input.focus(),
  };
}

/**
 * A form that carries `send` out; `refused(failure)` is called after a failure.
 *
 * Who has tried too often waits: the button counts the seconds down that the service asked for.
 * Returns `{ node, close() }`.
 */
export function entryForm(words, entries, send, refused = () => {}) {
  const button = element("button", { type: "submit" }, words);
  const failure = element("p", { class: "action-failure", role: "alert" });
  const node = element("form", { class: "entries" }, ...entries.map((one) => one.node), button, failure);
  const pause = pauseOf(button, words);
  node.addEventListener("submit", async (submitted) => {
    submitted.preventDefault();
    button.disabled = true;
    setText(failure, "");
    try {
      await send();
    } catch (error) {
      setText(failure, error.message);
      refused(error);
      if (error.retryAfterS) pause.begin(error.retryAfterS);
    } finally {
      button.disabled = pause.isOn();
    }
  });
  return { node, close: pause.end };
}

function pauseOf(button, words) {
  let timer = null;
  function end() {
    clearInterval(timer);
    timer = null;
    button.disabled = false;
    setText(button, words);
  }
  return {
    isOn: () => timer !== null,
    end,
    begin(seconds) {
      const overMs = performance.now() + seconds * 1000;
      const tick = () => {
        const leftS = Math.ceil((overMs - performance.now()) / 1000);
        if (leftS <= 0) end();
        else setText(button, `Wait ${formatAge(leftS)}`);
      };
      timer = setInterval(tick, 500);
      tick();
    },
  };
}
