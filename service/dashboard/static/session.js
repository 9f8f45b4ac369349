/** Who sits at this browser, as far as the service knows, and what he or she may do. */

import { NotReachable, ask, forget, tell } from "./api.js";

const CHANGED = "padwatch-session";

const PASSWORD_DOUBT =
  "The service has not confirmed the change of your password, so that it may or may not be changed. Try the new password first, then the old one.";

/** The lowest role that has each permission, for sentences. */
const ROLES = { act_on_alarms: "operator", change_measuring: "engineer", read_audit: "engineer", change_access: "admin" };

let known = null;

/** Whether a password change is unconfirmed; the next login ends that. */
let isPasswordUncertain = false;

/** `{ login_required, set_up_needed, password_change_needed, name, role, permissions }`; null until the service has said. */
export const session = () => known;

/** Whether the password was set by an administrator and must be changed first. */
export const mustChangePassword = () => known !== null && known.password_change_needed;

/** Whether the plant is hidden until a login or a change of the password. */
export const isLocked = () => mustChangePassword() || (known !== null && known.login_required && known.name === null);

/** Whether something is permitted; while nothing is known the service itself has the last word. */
export const may = (permission) => known === null || known.permissions.includes(permission);

/** Why something is not permitted, or null if it is. */
export function limitSentence(permission, what) {
  if (may(permission)) return null;
  if (known.name === null) return `To ${what}, log in.`;
  return `You are logged in as ${known.name}, ${known.role}: to ${what} takes the role ${ROLES[permission]}.`;
}

/** Why it is not known which password is valid, or null if it is known. */
export const passwordDoubt = () => (isPasswordUncertain ? PASSWORD_DOUBT : null);

/** Whether a login would allow more; in the demonstration none is needed. */
export const mayLogIn = () => known !== null && known.name === null && known.role === "viewer";

/** Request the session; the event `padwatch-session` reports a change. */
export async function askSession(signal) {
  settle(await ask(["session"], [], signal));
}

/** Log in, or throw the reason of a failure. */
export async function logIn(name, password) {
  const found = await tell(["session"], { name, password });
  isPasswordUncertain = false;
  settle(found);
}

/** Set another password; all other sessions of the account end, and without an answer perhaps this one. */
export async function changePassword(password, newPassword) {
  isPasswordUncertain = true; // the page may find the session ended before the answer comes
  try {
    const found = await tell(["session", "password"], { password, new_password: newPassword });
    isPasswordUncertain = false;
    settle(found);
  } catch (failure) {
    isPasswordUncertain = failure instanceof NotReachable;
    throw failure;
  }
}

/** End the session here and on the service. */
export async function logOut() {
  await tell(["session"], undefined, "DELETE");
  await askSession();
}

/** Make the first account with the token that the service has printed, and log in with it. */
export async function setUp(token, name, password) {
  await tell(["set-up"], { token, name, password });
  await logIn(name, password);
}

/** Call `redraw` after every change. */
export const onSession = (redraw) => window.addEventListener(CHANGED, redraw);

function settle(found) {
  const isNew = JSON.stringify(found) !== JSON.stringify(known);
  if (known !== null && found.name !== known.name) forget();
  known = found;
  if (isNew) window.dispatchEvent(new Event(CHANGED));
}
