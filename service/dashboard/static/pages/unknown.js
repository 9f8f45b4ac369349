/** An address that leads nowhere, for example from a mistyped link. */

import { element } from "../dom.js";

/** Returns `{ draw(view), close() }`. */
export function unknownPage(main) {
  main.append(
    element("h1", {}, "No such page"),
    element("p", { class: "sentence" }, "This address leads nowhere. ", element("a", { href: "#/" }, "Go to the overview")),
  );
  return { draw() {}, close() {} };
}
