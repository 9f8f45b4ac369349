/** Reports of alarms: every time one was raised, with its page to print and its evidence to take away. */

import { levelMark, placeWords, valueWords, whatWords } from "../alarm_words.js";
import { Refused, ask } from "../api.js";
import { element, setText } from "../dom.js";
import { formatTime } from "../format.js";
import { evidenceLinks } from "../parts/evidence.js";
import { listing, listingCell, listingName } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { poll } from "../poll.js";

const PERIOD_S = 10;
const N_EVENTS = "300";
const MOST_ALARMS = 30;
const HEADS = ["Raised", "Where", "What", "Level", "Value", "Report and evidence", "Samples"];

const STATES = {
  complete: "",
  waiting: "being written",
  lost: "lost: the disk did not take it",
  removed: "removed to make room",
  not_kept: "not kept here",
};

const SAMPLES = { complete: "kept", being_made: "being written", lost: "lost", removed: "removed to make room", none: "none here" };

/** Returns `{ node, close() }`. */
export function reportList() {
  const table = listing("Reports, the newest first", HEADS, "None yet: no alarm has been raised.", keyOf, reportRow);
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  let known = new Map();
  const questions = poll(async (signal) => {
    const { events } = await ask(["alarms", "events"], [["limit", N_EVENTS]], signal);
    const raised = events.filter(({ change }) => ["raised", "escalated"].includes(change));
    const kept = (known = await occurrencesOf(raised, known, signal));
    table.draw(raised.filter(({ alarm }) => kept.has(alarm)).map((event) => ({ event, kept: kept.get(event.alarm).get(event.occurrence) })));
    setText(sentence, "");
  }, () => PERIOD_S, (failure) => setText(sentence, `Reports cannot be listed now. ${failure.message}`));
  const node = element("section", { class: "panel listing reports" }, element("h2", {}, "Reports of alarms"), sentence, table.node);
  return { node, close: questions.stop };
}

const keyOf = ({ event }) => `${event.alarm} ${event.occurrence}`;

/** For each of the newest alarms what is kept of its occurrences, by number; asked for while that may change. */
async function occurrencesOf(raised, known, signal) {
  const found = new Map();
  for (const alarm of [...new Set(raised.map((event) => event.alarm))].slice(0, MOST_ALARMS)) {
    const numbers = raised.filter((event) => event.alarm === alarm).map(({ occurrence }) => occurrence);
    const before = known.get(alarm);
    found.set(alarm, before && numbers.every((n) => isFinal(before.get(n))) ? before : await askOccurrences(alarm, signal));
  }
  return found;
}

const isFinal = (kept) => kept !== undefined && kept.state !== "waiting" && kept.samples !== "being_made";

async function askOccurrences(alarm, signal) {
  try {
    const { occurrences } = await ask(["alarms", alarm, "evidence"], [], signal);
    return new Map(occurrences.map((one) => [one.occurrence, one]));
  } catch (failure) {
    if (!(failure instanceof Refused) || failure.status !== 404) throw failure;
    return new Map(); // no evidence is kept here, or of such an alarm
  }
}

function reportRow({ event }) {
  const level = mark();
  level.draw(...levelMark({ level: event.level, is_active: true }));
  const links = evidenceLinks();
  links.draw(event.alarm, event.occurrence);
  const state = element("span", { class: "from" });
  const samples = element("span");
  const contents = [placeWords(event), whatWords(event), level.node, valueWords(event), element("span", {}, links.node, state), samples];
  const cells = contents.map((content, n) => listingCell(HEADS[n + 1], content));
  const row = element("tr", { role: "row", "data-report": keyOf({ event }) }, listingName(formatTime(Date.parse(event.time))), ...cells);
  return {
    nodes: [row],
    draw({ kept }) {
      links.node.hidden = kept?.state !== "complete";
      setText(state, kept ? STATES[kept.state] : STATES.not_kept);
      setText(samples, kept ? SAMPLES[kept.samples] : SAMPLES.none);
    },
  };
}
