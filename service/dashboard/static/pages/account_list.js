/** Accounts of people: list, new account, and operations on each. */

import { ROLES } from "../access_words.js";
import { ask, tell } from "../api.js";
import { button, element, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { listing, listingCell, listingName, rowBelow } from "../parts/listing.js";
import { labelled, question } from "../parts/question.js";
import { session } from "../session.js";

const HEADS = ["Name", "Role", "Added", "Password set", ""];
const PASSWORD = { type: "password", autocomplete: "new-password", required: "", maxlength: "256" };
const PASSWORD_HELP = "Password, 12 characters or more";
const NO_ACCOUNT = "No account yet: in the demonstration no login is needed on this computer. Others can do so once there is an account.";

/** Returns `{ node, ask(signal) }`; `again` asks for all of it afresh. */
export function accountList(again) {
  const table = listing("Accounts", HEADS, NO_ACCOUNT, ({ name }) => name, (account) => accountRow(account, again));
  const name = element("input", { required: "", maxlength: "80", autocomplete: "off", autocapitalize: "none", spellcheck: "false" });
  const role = roleChoice("viewer");
  const password = element("input", PASSWORD);
  const fields = [labelled("Name", name), labelled("Role", role), labelled(PASSWORD_HELP, password)];
  const add = button("Add account…", () => form.open(add));
  const form = question("A new account", "Add", fields, () => tell(["accounts"], { name: name.value.trim(), role: role.value, password: password.value }), again);
  const head = element("div", { class: "panel-head" }, element("h2", {}, "People"), add);
  return {
    node: element("section", { class: "panel listing accounts" }, head, form.node, table.node),
    ask: async (signal) => table.draw(await ask(["accounts"], [], signal)),
  };
}

function accountRow({ name }, again) {
  const path = ["accounts", name];
  const title = element("span", {}, name);
  const texts = [1, 2, 3].map(() => element("span"));
  const role = roleChoice("viewer");
  const password = element("input", PASSWORD);
  const questions = [
    ["Role…", question(`What ${name} may do from the next click on`, "Set role", [labelled("Role", role)], () => tell([...path, "role"], { role: role.value }, "PUT"), again)],
    ...(name === session()?.name ? [] : [["Password…", question(`A password for ${name}, who is then logged out everywhere and changes it at the next login`, "Set password", [labelled(PASSWORD_HELP, password)], () => tell([...path, "password"], { password: password.value }, "PUT"), again)]]), // one's own is changed with the present one
    ["Remove…", question(`Remove ${name}, who is then logged out everywhere?`, "Remove", [], () => tell(path, undefined, "DELETE"), again)],
  ];
  const below = rowBelow(HEADS, ...questions.map(([, form]) => form.node));
  below.hidden = false;
  const buttons = questions.map(([words, form]) => opener(words, name, form, () => questions.map(([, one]) => one)));
  buttons[0].addEventListener("click", () => (role.value = texts[0].textContent)); // what it is now, not what was chosen and left
  const cells = [...texts, element("span", { class: "actions" }, ...buttons)].map((node, n) => listingCell(HEADS[n + 1], node));
  return {
    nodes: [element("tr", { role: "row", "data-account": name }, listingName(title), ...cells), below],
    draw(account) {
      [account.role, formatTime(Date.parse(account.created)), formatTime(Date.parse(account.password_set))].forEach((words, n) => setText(texts[n], words));
    },
  };
}

/** A button that opens its question and shuts the others of its row. */
export function opener(words, about, form, siblings) {
  const opening = button(words, () => {
    for (const one of siblings()) one.node.hidden = true;
    form.open(opening);
  }, { "aria-label": `${words.replace("…", "")} ${about}` });
  return opening;
}

export function roleChoice(chosen) {
  const choice = element("select", {}, ...ROLES.map(([value, words]) => element("option", { value }, words)));
  choice.value = chosen;
  return choice;
}
