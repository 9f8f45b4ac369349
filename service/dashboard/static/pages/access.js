/** Who may come in: accounts of people, and keys of machines. */

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
    await Promise.all(lists.map((list) => list.ask(signal)));
    setText(sentence, "");
  }, () => PERIOD_S, (failure) => setText(sentence, `Accounts and keys cannot be read now. ${failure.message}`));
  return { draw() {}, close: questions.stop };
}
