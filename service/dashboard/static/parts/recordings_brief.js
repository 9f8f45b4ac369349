/** The newest recordings of one unit in a few lines. */

import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { poll } from "../poll.js";
import { beingMadeWords, lengthWords, occasionWords, recordingTime } from "../recording_words.js";
import { RECORDINGS_ADDRESS } from "../route.js";

const PERIOD_S = 15;
const MOST = "4";

/** Returns `{ node, draw(), close() }`. */
export function recordingsBrief(unit) {
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const list = element("ul", { class: "brief-list" });
  const link = element("a", { class: "more", href: RECORDINGS_ADDRESS }, "All recordings and reports");
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Newest recordings"), link);
  const questions = poll(async (signal) => {
    const found = await ask(["recordings"], [["unit", unit], ["kind", "capture"], ["limit", MOST]], signal);
    const running = found.being_made.filter(({ alarm }) => alarm.startsWith(`${unit}:`));
    const lines = [...running.map((one) => element("li", {}, beingMadeWords(one))), ...found.recordings.map(recordingLine)];
    list.replaceChildren(...lines);
    setText(sentence, whatElse(lines.length, found.error));
  }, () => PERIOD_S, (failure) => {
    list.replaceChildren();
    setText(sentence, `Recordings are not known now. ${failure.message}`);
  });
  return {
    node: element("section", { class: "panel unit-recordings" }, head, list, sentence),
    draw() {},
    close: questions.stop,
  };
}

function whatElse(nLines, error) {
  if (error !== null) return `Samples are not kept just now: ${error}.`;
  return nLines === 0 ? "None yet: samples are kept when an alarm is raised." : "";
}

function recordingLine(recording) {
  const what = element("strong", {}, recordingTime(recording));
  return element("li", { "data-recording": recording.id }, what, element("span", {}, `${occasionWords(recording)} · ${lengthWords(recording)}`));
}
