/** API keys: a new one is shown once; each says when it was used last and when it ends. */

import { keyMark, unitsOf, unitsWords, usedWords } from "../access_words.js";
import { ask, tell } from "../api.js";
import { button, element, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { listing, listingCell, listingName, rowBelow } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { labelled, question } from "../parts/question.js";
import { serviceTimeMs } from "../server_time.js";
import { opener, roleChoice } from "./account_list.js";
import { newKey } from "./new_key.js";

const HEADS = ["For", "Id", "Role", "Units", "State", "Ends", "Last used", ""];
const NONE = "No key yet. Programs that read from padwatch over the network need one.";

/** Returns `{ node, ask(signal) }`; `again` asks for all of it afresh. */
export function keyList(again) {
  const table = listing("Keys", HEADS, NONE, ({ id }) => id, (key) => keyRow(key, again));
  const name = element("input", { required: "", maxlength: "80", autocomplete: "off", autocapitalize: "none", spellcheck: "false" });
  const role = roleChoice("viewer");
  const units = element("input", { placeholder: "all", maxlength: "2000", autocapitalize: "none", spellcheck: "false" });
  const days = element("input", { type: "number", required: "", min: "1", max: "3650", value: "365" });
  const fields = [labelled("What it is for", name), labelled("Role", role), labelled("Only these units", units), labelled("Days valid", days)];
  const shown = newKey();
  const create = button("Create a key…", () => form.open(create));
  const form = question("A new key for a machine", "Create", fields, async () => {
    shown.show(await tell(["keys"], { name: name.value.trim(), role: role.value, units: unitsOf(units.value), days: Number(days.value) }));
  }, again);
  const head = element("div", { class: "panel-head" }, element("h2", {}, "API keys"), create);
  return {
    node: element("section", { class: "panel listing keys" }, head, form.node, shown.node, table.node),
    ask: async (signal) => table.draw(await ask(["keys"], [], signal)),
  };
}

function keyRow({ id, name }, again) {
  const state = mark();
  const texts = ["role", "units", "expires", "used"].map(() => element("span"));
  const revoke = question(`Take the key of ${name} back for ever? What uses it is shut out at once.`, "Revoke", [], () => tell(["keys", id], undefined, "DELETE"), again);
  const revoking = opener("Revoke…", `${name} ${id}`, revoke, () => []);
  const below = rowBelow(HEADS, revoke.node);
  below.hidden = false;
  const [role, units, ends, used] = texts;
  const cells = [element("code", {}, id), role, units, state.node, ends, used, revoking].map((node, n) => listingCell(HEADS[n + 1], node));
  return {
    nodes: [element("tr", { role: "row", "data-key": id }, listingName(name), ...cells), below],
    draw(key) {
      state.draw(...keyMark(key, serviceTimeMs()));
      revoking.hidden = key.state !== "valid";
      [key.role, unitsWords(key), formatTime(Date.parse(key.expires)), usedWords(key)].forEach((words, n) => setText(texts[n], words));
    },
  };
}
