/** What the player plays and how it is drawn: live or a recording, turns, whole motion or 1× alone. */

import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { keptChoice } from "../parts/kept_choice.js";
import { lengthWords, occasionWords, recordingTime } from "../recording_words.js";

const TURNS = [[1, "1"], [3, "3"], [8, "8"]];
const PARTS = [["both", "Whole and 1×"], ["whole", "Whole"], ["alone", "1× alone"]];
const FRAMES = [["fit", "To fit"], ["clearance", "In the clearance"]];
const MOST_RECORDINGS = 100;

/** `choose(recording)` with its name, or null for now; `show` when the drawing changes; `chosen` at first. */
export function orbitChoices(unit, chosen, choose, show) {
  const select = element("select", { id: "orbit-source" }, element("option", { value: "" }, "Now, live"));
  const note = element("span", { class: "hint", role: "status" });
  const source = element("label", { class: "setting" }, "Play ", select);
  const parts = keptChoice("motion", "Motion", PARTS, "both", show);
  const turns = keptChoice("turns", "Turns", TURNS, 3, show);
  const frame = keptChoice("frame", "Frame", FRAMES, "fit", show);
  select.addEventListener("change", () => choose(select.value || null));
  offer(select, note, unit, chosen);
  return {
    node: element("div", { class: "choices" }, source, note, parts.node, turns.node, frame.node),
    how: () => ({
      turns: turns.value(),
      whole: parts.value() !== "alone",
      alone: parts.value() !== "whole",
      inClearance: frame.value() === "clearance",
    }),
  };
}

async function offer(select, note, unit, chosen) {
  try {
    const { recordings } = await ask(["recordings"], [["unit", unit], ["limit", String(MOST_RECORDINGS)]]);
    const whole = recordings.filter(({ state }) => state === "complete");
    for (const each of whole) {
      select.append(element("option", { value: each.id }, `${recordingTime(each)}, ${lengthWords(each)}: ${occasionWords(each)}`));
    }
    if (chosen !== null && whole.every(({ id }) => id !== chosen)) select.append(element("option", { value: chosen }, chosen));
    select.value = chosen ?? "";
    setText(note, whole.length ? "" : "No recording of this unit is kept yet; one is made around every alarm of vibration.");
  } catch (failure) {
    setText(note, `Recordings cannot be listed. ${failure.message}`);
  }
}
