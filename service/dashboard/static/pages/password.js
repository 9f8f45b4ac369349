/** New password of the logged-in account. */

import { element, setText } from "../dom.js";
import { entry, entryForm } from "../parts/entry.js";
import { changePassword, mustChangePassword, session } from "../session.js";

const NOT_LOGGED_IN = "You are not logged in: there is no password to change.";
const EXPLANATION = "12 characters or more; several words are easy to remember and hard to guess. Wherever else you are logged in, that ends.";

const SET_BY_OTHERS = "An administrator set your password: change it first. ";

/** Whose password has been changed: the page may have been opened anew with the new session meanwhile. */
let changed = null;

/** Returns `{ draw(view), close() }`. */
export function passwordPage(main) {
  const name = session()?.name ?? null;
  const title = element("h1", {}, "Your password");
  const words = element("p", { class: "sentence" }, name === null ? NOT_LOGGED_IN : mustChangePassword() ? SET_BY_OTHERS + EXPLANATION : EXPLANATION);
  const box = element("section", { class: "panel door" }, title, words);
  main.append(box);
  if (name === null) return { draw() {}, close() {} };
  const done = element("p", { class: "sentence", role: "status" });
  const form = passwordForm(name);
  form.node.addEventListener("input", () => (changed = null));
  box.append(form.node, done);
  return { draw: () => setText(done, changed === name ? "Your password is changed." : ""), close: form.close };
}

function passwordForm(name) {
  const user = element("input", { type: "text", hidden: "", autocomplete: "username", value: name }); // for password managers
  const now = entry("Password now", { name: "password", type: "password", autocomplete: "current-password", maxlength: "1024" });
  const wanted = entry("New password", { name: "new-password", type: "password", autocomplete: "new-password", maxlength: "256" });
  const again = entry("New password again", { name: "new-password-again", type: "password", autocomplete: "new-password", maxlength: "256" });
  const fields = [{ node: user }, now, wanted, again];
  return entryForm("Change it", fields, async () => {
    if (wanted.value() !== again.value()) throw new Error("The two new passwords are not the same.");
    await changePassword(now.value(), wanted.value());
    for (const field of [again, wanted, now]) field.empty();
    changed = name;
  });
}
