/** What is kept of alarms: recordings of samples, and reports with their evidence. */

import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { listing } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { poll } from "../poll.js";
import { beingMadeWords } from "../recording_words.js";
import { RECORDING_HEADS, recordingRow } from "./recording_row.js";
import { reportList } from "./report_list.js";

const PERIOD_S = 10;
const MOST = "200";

/** Returns `{ draw(view), close() }`. */
export function recordingsPage(main) {
  const lists = [captureList(), continuousList(), reportList()];
  main.append(element("div", { class: "page-head" }, element("h1", {}, "Recordings and reports")), ...lists.map(({ node }) => node));
  return {
    draw() {},
    close() {
      for (const list of lists) list.close();
    },
  };
}

const NOTHING =
  "None yet. When an alarm is raised, padwatch keeps the samples around it by itself. To record at another time, use the command padwatch record.";

function captureList() {
  return recordingList("Recordings of samples", "recordings", "capture", NOTHING, ({ being_made: running, error }) => [
    running.map(beingMadeWords).join(" "),
    error && `Samples are not kept just now: ${error}.`,
  ]);
}

/** Stretches of all samples; not there where none are kept. */
function continuousList() {
  const list = recordingList("Continuous recordings", "continuous", "continuous", "None yet.", ({ recordings, continuous: units, ...found }) => {
    list.node.hidden = recordings.length === 0 && units.length === 0;
    return [
      units.length ? `All samples of ${units.join(", ")} are recorded.` : "No unit is recorded continuously now.",
      found.continuous_error && `Not all samples are recorded just now: ${found.continuous_error}.`,
    ];
  });
  list.node.hidden = true;
  return list;
}

/** `wordsOf(answer)` gives a sentence above the list, and what is wrong with recording, or null. */
function recordingList(title, style, kind, nothing, wordsOf) {
  const table = listing(`${title}, the newest first`, RECORDING_HEADS, nothing, ({ id }) => id, recordingRow);
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const trouble = mark();
  const head = element("div", { class: "panel-head" }, element("h2", {}, title), trouble.node);
  const questions = poll(async (signal) => {
    const found = await ask(["recordings"], [["kind", kind], ["limit", MOST]], signal);
    table.draw(found.recordings);
    const [words, wrong] = wordsOf(found);
    setText(sentence, words);
    trouble.node.hidden = wrong === null;
    trouble.draw("bad", wrong ?? "");
  }, () => PERIOD_S, (failure) => {
    trouble.node.hidden = true;
    setText(sentence, `What has been recorded is not known now. ${failure.message}`);
  });
  trouble.node.hidden = true;
  return { node: element("section", { class: `panel listing ${style}` }, head, sentence, table.node), close: questions.stop };
}
