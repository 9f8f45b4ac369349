/** What an engineer does to baselines, with the reason: one form for all of it. */

import { tell } from "../api.js";
import { element, setText } from "../dom.js";
import { formatZone } from "../format.js";
import { nameField } from "../parts/actor.js";

const ACTIONS = {
  accept: ["Accept", (version) => `Compare the bearing with version ${version} from its next reading on.`],
  reject: ["Reject", (version) => `Compare the bearing with version ${version} no longer.`],
  freeze: ["Freeze", () => "Keep the version in force, and learn no further."],
  thaw: ["Thaw", () => "Learn again."],
  renew: ["Renew", () => "Begin a new baseline after a machine event: older readings count no longer, and nothing is in force until it has been learned."],
};

/** Returns `{ node, open(action, version, opener) }`; `again` asks for the baselines afresh. */
export function baselineForm(path, again) {
  const title = element("strong");
  const reason = element("input", { name: "reason", required: "", maxlength: "500" });
  const event = element("input", { name: "event", type: "datetime-local" });
  const eventLabel = element("label", {}, "");
  const zone = element("span");
  eventLabel.replaceChildren(zone, event);
  const send = element("button", { type: "submit" });
  const cancel = element("button", { type: "button" }, "Cancel");
  const failure = element("span", { class: "action-failure", role: "alert" });
  const who = nameField();
  const fields = [title, eventLabel, element("label", {}, "Why", reason), who.node, send, cancel, failure];
  const node = element("form", { class: "baseline-form", hidden: "" }, ...fields);
  let asked = null;

  function close() {
    node.hidden = true;
    if (asked?.opener.isConnected) asked.opener.focus();
    asked = null;
  }

  async function submit() {
    const name = who.take();
    who.draw();
    try {
      await tell([...path, "baselines", ...stepOf(asked)], bodyOf(asked, name, reason.value.trim(), event.value));
      close();
    } catch (error) {
      setText(failure, error.message);
    }
    again();
  }

  node.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    submit();
  });
  node.addEventListener("keydown", (key) => key.key === "Escape" && close());
  cancel.addEventListener("click", close);
  return {
    node,
    open(action, version, opener) {
      asked = { action, version, opener };
      const [word, sentence] = ACTIONS[action];
      setText(title, sentence(version));
      setText(send, word);
      setText(failure, "");
      setText(zone, `When the event was over, ${formatZone(Date.now())}`);
      eventLabel.hidden = action !== "renew";
      event.required = action === "renew";
      reason.value = "";
      who.draw();
      node.hidden = false;
      (action === "renew" ? event : reason).focus();
    },
  };
}

const stepOf = ({ action, version }) => (version === null ? [action] : [String(version), action]);

function bodyOf({ action }, actor, reason, event) {
  const body = { actor, reason };
  return action === "renew" ? { ...body, event_time: new Date(event).toISOString() } : body;
}
