/** What an engineer does to baselines, with the reason: one form for all of it. */

import { tell } from "../api.js";
import { element } from "../dom.js";
import { formatZone } from "../format.js";
import { nameField } from "../parts/actor.js";
import { labelled, question } from "../parts/question.js";

const ACTIONS = {
  accept: ["Accept", (version) => `Compare the bearing with version ${version} from its next reading on.`],
  reject: ["Reject", (version) => `Compare the bearing with version ${version} no longer.`],
  freeze: ["Freeze", () => "Keep the version in force, and learn no further."],
  thaw: ["Thaw", () => "Learn again."],
  renew: ["Renew", () => "Start a new baseline after an overhaul: earlier readings are ignored, and film alarms stay off until it is learned."],
};

/** Returns `{ node, open(action, version, opener) }`; `again` asks for the baselines afresh. */
export function baselineForm(path, again) {
  const node = element("div");
  return {
    node,
    open(action, version, opener) {
      const [words, sentence] = ACTIONS[action];
      const reason = element("input", { name: "reason", required: "", maxlength: "500" });
      const event = element("input", { name: "event", type: "datetime-local", required: "" });
      const ended = labelled(`When the event was over, ${formatZone(Date.now())}`, event);
      const who = nameField();
      const isRenewal = action === "renew";
      const step = version === null ? [action] : [String(version), action];
      const send = () => {
        const body = { actor: who.take(), reason: reason.value.trim() };
        if (isRenewal) body.event_time = new Date(event.value).toISOString();
        return tell([...path, "baselines", ...step], body);
      };
      const form = question(sentence(version), words, [...(isRenewal ? [ended] : []), labelled("Why", reason), who.node], send, again);
      who.draw();
      node.replaceChildren(form.node);
      form.open(opener);
    },
  };
}
