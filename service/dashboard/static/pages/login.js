/** The door: name and password, then on to the page that was asked for. */

import { element, setText } from "../dom.js";
import { entry, entryForm } from "../parts/entry.js";
import { logIn, passwordDoubt } from "../session.js";

/** Returns `{ draw(view), close() }`. */
export function loginPage(main) {
  const name = entry("Name", { name: "username", autocomplete: "username", autocapitalize: "none", spellcheck: "false", maxlength: "80" });
  const password = entry("Password", { name: "password", type: "password", autocomplete: "current-password", maxlength: "1024" });
  const form = entryForm("Log in", [name, password], () => logIn(name.value(), password.value()), (failure) => {
    if (failure.status === 401) password.empty();
  });
  const doubt = element("p", { class: "sentence", role: "status" });
  const forgotten = element("p", { class: "help" });
  setText(forgotten, "Forgotten? An admin of padwatch can give you a new password.");
  main.append(element("section", { class: "panel door" }, element("h1", {}, "Log in"), doubt, form.node, forgotten));
  name.focus();
  return { draw: () => setText(doubt, passwordDoubt() ?? ""), close: form.close };
}
