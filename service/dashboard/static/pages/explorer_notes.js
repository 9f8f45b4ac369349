/** Notes about the bearings shown, in the time shown, and a form to add one. */

import { tell } from "../api.js";
import { element, setText } from "../dom.js";
import { formatTime, formatZone } from "../format.js";
import { actorField, nameField } from "../parts/actor.js";
import { localSecond } from "./explorer_time.js";

/** Returns `{ node, show(found, [startMs, endMs]) }`; `again` asks for the trends afresh. */
export function explorerNotes(again) {
  const list = element("ul", { class: "notes" });
  const about = element("select", { "aria-label": "About" });
  const time = element("input", { type: "datetime-local", step: "1", required: "" });
  const text = element("input", { required: "", maxlength: "500", placeholder: "for example: shims changed" });
  const failure = element("span", { class: "action-failure", role: "alert" });
  const actor = actorField("act_on_alarms", "add notes");
  const who = nameField();
  who.draw();
  const form = element(
    "form",
    { class: "asking", "aria-label": "Add a note", hidden: "" },
    element("label", {}, "About ", about),
    element("label", {}, `Time (${formatZone(Date.now())}) `, time),
    element("label", {}, "Note ", text),
    who.node,
    element("button", { type: "submit" }, "Add note"),
    failure,
  );
  const node = element("section", { class: "panel explorer-notes", "aria-label": "Notes" }, element("h2", {}, "Notes"), list, actor.node, ...(actor.may ? [form] : []));

  form.addEventListener("submit", async (submitted) => {
    submitted.preventDefault();
    const [unit, bearing] = about.value.split("/");
    const body = { actor: who.take(), text: text.value, time: new Date(time.value).toISOString(), bearing: bearing ?? null };
    try {
      await tell(["units", unit, "notes"], body);
      [failure.textContent, text.value] = ["", ""];
      for (const one of [who, actor]) one.draw();
      again();
    } catch (refused) {
      setText(failure, refused.message);
    }
  });

  return {
    node,
    show(found, [, endMs]) {
      form.hidden = found.length === 0;
      const notes = found.flatMap(({ bearing: [unit], beside }) => beside.notes.map((note) => `${note.time} ${wordsOf(unit, note)}`));
      const rows = [...new Set(notes)].sort().reverse().map((note) => element("li", {}, note.replace(/^\S+/, (time) => formatTime(Date.parse(time)))));
      list.replaceChildren(...(rows.length ? rows : [element("li", { class: "sentence" }, "No notes in this time.")]));
      time.value ||= localSecond(endMs);
      const places = [...new Set(found.flatMap(({ bearing: [unit, bearing] }) => [`${unit}/${bearing}`, unit]))];
      if (places.join() === [...about.options].map(({ value }) => value).join()) return;
      about.replaceChildren(...places.map((place) => element("option", { value: place }, place.replace("/", " "))));
    },
  };
}

const wordsOf = (unit, { bearing, text, author }) => `${[unit, bearing].filter(Boolean).join(" ")}: ${text} (${author})`;
