/** A page that is not for everybody, said in words. */

import { element } from "../dom.js";
import { limitSentence } from "../session.js";

/** Returns `{ draw(view), close() }`. */
export function forbiddenPage(main, permission) {
  const words = limitSentence(permission, "see this page");
  main.append(element("h1", {}, "Not for your role"), element("p", { class: "sentence" }, words));
  return { draw() {}, close() {} };
}
