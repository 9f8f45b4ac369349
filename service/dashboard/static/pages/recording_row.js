/** One recording in the list, with its check and the ways to take it away. */

import { bearingOf } from "../alarm_place.js";
import { ask } from "../api.js";
import { element, setAttribute, setText } from "../dom.js";
import { formatCount, formatFixed } from "../format.js";
import { listingCell, listingName, rowBelow } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { lengthWords, occasionWords, recordingTime, sizeWords } from "../recording_words.js";
import { orbitAddress, unitAddress } from "../route.js";

export const RECORDING_HEADS = ["Begins", "Unit", "Made for", "Length", "Size", "State", ""];

const STATES = { complete: ["good", "Complete"], damaged: ["bad", "Damaged"] };

/** Returns `{ nodes, draw(recording) }`. */
export function recordingRow({ id }) {
  const begins = element("span");
  const unit = element("a");
  const texts = RECORDING_HEADS.slice(2, 5).map(() => element("span"));
  const state = mark();
  const check = element("button", { type: "button" }, "Check");
  const path = `/api/v1/recordings/${encodeURIComponent(id)}`;
  const ways = [element("a", { href: `${path}/files.zip`, download: "" }, "Files"), element("a", { href: `${path}/samples.csv`, download: "" }, "CSV")];
  const play = element("a", { hidden: "" }, "Orbit player");
  const actions = element("span", { class: "actions" }, check, play, ...ways);
  const cells = [unit, ...texts, state.node, actions].map((node, n) => listingCell(RECORDING_HEADS[n + 1], node));
  const row = element("tr", { role: "row", "data-recording": id }, listingName(begins), ...cells);
  const said = element("p", { class: "advice", role: "status" });
  const below = rowBelow(RECORDING_HEADS, said);
  let checked = null;
  let shown = null;

  function drawState() {
    state.draw(...(checked ?? STATES[shown.state]));
  }

  check.addEventListener("click", async () => {
    check.disabled = true;
    below.hidden = false;
    setText(said, "Reading all of it.");
    const found = await checkedRecording(id);
    check.disabled = false;
    checked = found.state;
    setText(said, found.words);
    drawState();
  });
  return {
    nodes: [row, below],
    draw(recording) {
      shown = recording;
      setText(begins, recordingTime(recording));
      setText(unit, recording.unit ?? "");
      if (recording.unit !== null) setAttribute(unit, "href", unitAddress(recording.unit));
      [occasionWords(recording), lengthWords(recording), sizeWords(recording.n_bytes)].forEach((words, n) => setText(texts[n], words));
      const bearing = bearingToPlay(recording);
      play.hidden = bearing === null;
      if (bearing !== null) setAttribute(play, "href", orbitAddress(recording.unit, bearing, recording.id));
      setAttribute(check, "aria-label", `Check the recording of ${recordingTime(recording)}`);
      if (recording.reason !== null && checked === null) {
        below.hidden = false;
        setText(said, recording.reason);
      }
      drawState();
    },
  };
}

/** The bearing that a recording was made for; null if it was made for none. */
function bearingToPlay({ unit, alarms }) {
  if (unit === null || alarms.length === 0) return null;
  const [, subject, kind] = alarms[0].alarm.split(":");
  return bearingOf({ subject, kind: kind ?? "" });
}

/** Reads a recording from end to end: whether it is whole, and what is in it. */
async function checkedRecording(id) {
  try {
    const found = await ask(["recordings", id]);
    return { state: ["good", "Checked, whole"], words: contentsWords(found) };
  } catch (failure) {
    return failure.status === 410 ? { state: ["bad", "Damaged"], words: failure.message } : { state: null, words: `Not checked. ${failure.message}` };
  }
}

function contentsWords(found) {
  const count = (byChannel) => Object.keys(byChannel).length;
  const { channels, slow_channels: slow, n_gaps: gaps, n_gap_samples: missing, rejected, epochs, n_not_ok: notOk, made_by: by, recording } = found;
  const refused = Object.values(rejected).reduce((sum, count) => sum + count, 0);
  const parts = [
    `Every checksum is right. ${count(channels)} channels at ${formatFixed(recording.rate_hz, 0)} samples per second, ${count(slow)} slow ones`,
    gaps === 0 ? "no holes" : `${gaps} holes, ${formatCount(missing)} samples missing`,
  ];
  if (refused) parts.push(`${formatCount(refused)} samples rejected`);
  if (epochs.length > 1) parts.push(`the device restarted ${epochs.length - 1}×`);
  if (count(notOk)) parts.push(`not OK for a while: ${Object.keys(notOk).join(", ")}`);
  return `${parts.join("; ")}. Made by ${by}.`;
}
