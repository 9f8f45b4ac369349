/** A service that has no account yet: its token is needed to create the first one. */

import { element } from "../dom.js";
import { entry, entryForm } from "../parts/entry.js";
import { setUp } from "../session.js";

const EXPLANATION =
  "padwatch has no account yet. On its computer it has written a token, which works once. With it you make the first account, an admin, who then makes those of others.";

/** Returns `{ draw(view), close() }`. */
export function setUpPage(main) {
  const token = entry("Token", { name: "token", autocomplete: "off", autocapitalize: "none", spellcheck: "false", maxlength: "200" });
  const name = entry("Your name", { name: "username", autocomplete: "username", autocapitalize: "none", spellcheck: "false", maxlength: "80" });
  const password = entry("Password", { name: "password", type: "password", autocomplete: "new-password", maxlength: "1024" });
  const again = entry("Password again", { name: "password-again", type: "password", autocomplete: "new-password", maxlength: "1024" });
  const form = entryForm("Make the first account", [token, name, password, again], async () => {
    if (password.value() !== again.value()) throw new Error("The two passwords are not the same.");
    await setUp(token.value(), name.value(), password.value());
  });
  const words = element("p", { class: "sentence" }, EXPLANATION);
  main.append(element("section", { class: "panel door" }, element("h1", {}, "Set up padwatch"), words, form.node));
  token.focus();
  return { draw() {}, close: form.close };
}
