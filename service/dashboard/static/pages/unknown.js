/** An address that leads nowhere, for example from a mistyped link. */

import { element } from "../dom.js";

/** Returns `{ draw(view), close() }`. */
export function unknownPage(main) {
  main.append(
    element("h1", {}, "Page not found"),
    element("p", { class: "sentence" }, "There is no page at this address. ", element("a", { href: "#/" }, "Go to the overview")),
  );
  return { draw() {}, close() {} };
}
