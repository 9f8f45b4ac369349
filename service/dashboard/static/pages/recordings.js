/** What is kept of alarms: recordings of samples, and reports with their evidence. */

import { NotReachable, ask } from "../api.js";
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
  const recordings = captureList();
  const continuous = continuousList();
  const reports = reportList();
  main.append(element("div", { class: "page-head" }, element("h1", {}, "Recordings and reports")), recordings.node, continuous.node, reports.node);
  return {
    draw() {},
    close() {
      recordings.close();
      continuous.close();
      reports.close();
    },
  };
}

const NOTHING =
  "None yet. When an alarm is raised, padwatch keeps the samples around it by itself. To record at another time, use the command padwatch record.";

function captureList() {
  const table = listing("Recordings, the newest first", RECORDING_HEADS, NOTHING, ({ id }) => id, recordingRow);
  const running = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const trouble = mark();
  const questions = poll(async (signal) => {
    try {
      const found = await ask(["recordings"], [["kind", "capture"], ["limit", MOST]], signal);
      table.draw(found.recordings);
      setText(running, found.being_made.map(beingMadeWords).join(" "));
      trouble.node.hidden = found.error === null;
      trouble.draw("bad", `Samples are not kept just now: ${found.error}.`);
    } catch (failure) {
      if (signal.aborted) return;
      trouble.node.hidden = true;
      const words = failure instanceof NotReachable ? `Service not reachable. ${failure.message}` : failure.message;
      setText(running, `What has been recorded is not known now. ${words}`);
    }
  }, () => PERIOD_S);
  trouble.node.hidden = true;
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Recordings of samples"), trouble.node);
  return { node: element("section", { class: "panel listing recordings" }, head, running, table.node), close: questions.stop };
}

/** Stretches of all samples; not there where none are kept. */
function continuousList() {
  const table = listing("Continuous recordings, the newest first", RECORDING_HEADS, "None yet.", ({ id }) => id, recordingRow);
  const trouble = mark();
  const words = element("p", { class: "sentence", role: "status" });
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Continuous recordings"), trouble.node);
  const node = element("section", { class: "panel listing continuous", hidden: "" }, head, words, table.node);
  const questions = poll(async (signal) => {
    try {
      const found = await ask(["recordings"], [["kind", "continuous"], ["limit", MOST]], signal);
      table.draw(found.recordings);
      node.hidden = found.recordings.length === 0 && found.continuous.length === 0;
      setText(words, found.continuous.length ? `All samples of ${found.continuous.join(", ")} are recorded.` : "No unit is recorded continuously now.");
      trouble.node.hidden = found.continuous_error === null;
      trouble.draw("bad", `Not all samples are recorded just now: ${found.continuous_error}.`);
    } catch (failure) {
      if (!signal.aborted) setText(words, `What has been recorded is not known now. ${failure.message}`);
    }
  }, () => PERIOD_S);
  trouble.node.hidden = true;
  return { node, close: questions.stop };
}
