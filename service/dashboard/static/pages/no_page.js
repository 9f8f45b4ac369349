/** What is shown in place of a page that is not there, or not for everybody. */

import { element } from "../dom.js";
import { limitSentence } from "../session.js";

const INERT = { draw() {}, close() {} };

/** An address that leads nowhere, for example from a mistyped link. */
export function unknownPage(main) {
  const way = element("a", { href: "#/" }, "Go to the overview");
  main.append(element("h1", {}, "Page not found"), element("p", { class: "sentence" }, "There is no page at this address. ", way));
  return INERT;
}

/** A page that needs a permission which the user does not have. */
export function forbiddenPage(main, permission) {
  main.append(element("h1", {}, "Not for your role"), element("p", { class: "sentence" }, limitSentence(permission, "see this page")));
  return INERT;
}
