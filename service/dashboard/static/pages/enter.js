/** Login page for a user who sees the plant without a login; it returns to the page before. */

import { session } from "../session.js";
import { loginPage } from "./login.js";
import { setUpPage } from "./set_up.js";

let before = "#/";

/** Note the page that is open, to come back to it. */
export function rememberPage() {
  before = location.hash || "#/";
}

/** Returns `{ draw(view), close() }`. */
export function enterPage(main) {
  if (session()?.name) {
    location.replace(before);
    return { draw() {}, close() {} };
  }
  return session()?.set_up_needed ? setUpPage(main) : loginPage(main);
}
