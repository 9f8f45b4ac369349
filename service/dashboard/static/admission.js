/** Which page opens for an address, by login and permissions. */

import { NO_PAGE, PAGES } from "./pages.js";
import { forbiddenPage } from "./pages/no_page.js";
import { loginPage } from "./pages/login.js";
import { passwordPage } from "./pages/password.js";
import { setUpPage } from "./pages/set_up.js";
import { routeOf } from "./route.js";
import { isLocked, may, mustChangePassword, session } from "./session.js";

const LOGIN_PAGE = { title: "log in", open: loginPage };
const PASSWORD_PAGE = { title: "your password", open: passwordPage };
const SET_UP_PAGE = { title: "set up", open: setUpPage };

/**
 * The page to open, with the segments of its address.
 *
 * Before a login it is the login page, and then the form for a password set by an administrator, whatever
 * the address: that stays, and leads on.
 */
export function pageOf(hash) {
  if (mustChangePassword()) return { page: PASSWORD_PAGE, segments: [] };
  if (isLocked()) return { page: session().set_up_needed ? SET_UP_PAGE : LOGIN_PAGE, segments: [] };
  const { page, segments } = routeOf(hash, PAGES) ?? { page: NO_PAGE, segments: [] };
  const { permission } = page;
  if (permission === undefined || may(permission)) return { page, segments };
  return { page: { ...page, open: (main) => forbiddenPage(main, permission) }, segments };
}
