/** Who may come in: accounts of people, and keys of machines. */

import { NotReachable } from "../api.js";
import { element, setText } from "../dom.js";
import { poll } from "../poll.js";
import { accountList } from "./account_list.js";
import { keyList } from "./key_list.js";

const PERIOD_S = 15;

/** Returns `{ draw(view), close() }`. */
export function accessPage(main) {
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const again = () => questions.again();
  const lists = [accountList(again), keyList(again)];
  main.append(element("div", { class: "page-head" }, element("h1", {}, "Access")), sentence, ...lists.map(({ node }) => node));
  const questions = poll(async (signal) => {
    try {
      await Promise.all(lists.map((list) => list.ask(signal)));
      setText(sentence, "");
    } catch (failure) {
      if (signal.aborted) return;
      const words = failure instanceof NotReachable ? `Service not reachable. ${failure.message}` : failure.message;
      setText(sentence, `Accounts and keys cannot be read now. ${words}`);
    }
  }, () => PERIOD_S);
  return { draw() {}, close: questions.stop };
}
