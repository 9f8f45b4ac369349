/** Who is logged in, and the way out, or the way in; nothing where no login is needed. */

import { element, setText } from "../dom.js";
import { rememberPage } from "../pages/enter.js";
import { logOut, mayLogIn, session } from "../session.js";

/** Returns `{ node, draw() }`. */
export function personView() {
  const who = element("span");
  const password = element("a", { href: "#/password" }, "Password");
  const leave = element("button", { type: "button" }, "Log out");
  const enter = element("a", { href: "#/login" }, "Log in");
  enter.addEventListener("click", () => location.hash !== "#/login" && rememberPage());
  const failure = element("span", { class: "action-failure", role: "alert" });
  leave.addEventListener("click", async () => {
    try {
      await logOut();
      setText(failure, "");
    } catch (error) {
      setText(failure, `Not logged out: ${error.message}`);
    }
  });
  const node = element("span", { class: "person", hidden: "" }, who, password, leave, enter, failure);
  return {
    node,
    draw() {
      const known = session();
      node.hidden = !known?.name && !mayLogIn();
      enter.hidden = !mayLogIn();
      for (const part of [who, password, leave, failure]) part.hidden = !known?.name;
      if (known?.name) setText(who, `${known.name}, ${known.role}`);
    },
  };
}
