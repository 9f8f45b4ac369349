/** One source in the table: the worst about it in a line, and all that is known of it below. */

import { element, setAttribute, setText } from "../dom.js";
import { formatAge, formatCount, formatFixed, formatTime } from "../format.js";
import { listingCell, listingName, rowBelow } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { unitAddress } from "../route.js";
import { addressWords, identityWords, reasonsWords, received, rejected, shareWords, sourceKindWords } from "../source_words.js";

export const HEADS = ["Unit", "State", "For", "Data age", "Received", "Missing", "Rejected", "Lag", "Device clock", "Poll", ""];

const DASH = "—";

/** Kinds whose samples are taken when padwatch asks: they have no rate that could drift. */
const SAMPLED_WHEN_ASKED = ["modbus_polled", "modbus_vector"];

/** Returns `{ nodes, draw(found) }`. */
export function sourceRow({ source: { unit }, name }) {
  const state = mark();
  const texts = HEADS.slice(2, -1).map(() => element("span"));
  const link = element("a", { href: unitAddress(unit) }, name);
  const more = element("button", { type: "button", "aria-expanded": "false", "aria-controls": `source-${unit}` }, "Details");
  const cells = [state.node, ...texts, more].map((node, n) => listingCell(HEADS[n + 1], node));
  const row = element("tr", { role: "row", "data-source": unit }, listingName(link), ...cells);
  const advice = element("p", { class: "advice" });
  const facts = element("dl", { class: "facts", id: `source-${unit}`, hidden: "" });
  const below = rowBelow(HEADS, advice, facts);
  setAttribute(more, "aria-label", `Details of ${name}`);

  function fold() {
    below.hidden = advice.hidden && facts.hidden;
  }

  more.addEventListener("click", () => {
    facts.hidden = !facts.hidden;
    setAttribute(more, "aria-expanded", String(!facts.hidden));
    fold();
  });
  return {
    nodes: [row, below],
    draw({ source, trouble, settings, nowMs }) {
      state.draw(trouble.look, trouble.words);
      setAttribute(row, "data-look", trouble.look);
      lineWords(source, nowMs).forEach((words, n) => setText(texts[n], words));
      const why = source.reason ? `${source.reason}. ` : "";
      advice.hidden = trouble.advice === "";
      setText(advice, `${why}${trouble.advice}`);
      drawFacts(facts, factsOf(source, settings));
      fold();
    },
  };
}

function lineWords(source, nowMs) {
  return [
    source.since === null ? DASH : formatAge((nowMs - Date.parse(source.since)) / 1000),
    source.data_age_s === null ? "none yet" : formatAge(source.data_age_s),
    formatCount(received(source)),
    shareWords(source.n_gap, source.n_offered),
    shareWords(rejected(source), source.n_offered),
    source.last_sample_time === null ? DASH : `${formatFixed((nowMs - Date.parse(source.last_sample_time)) / 1000, 1)} s`,
    clockBrief(source.clock),
    source.polls === null ? DASH : durationWords(source.polls.newest_s),
  ];
}

function clockBrief(clock) {
  if (!clock || clock.offset_s === null) return DASH;
  return `${clock.offset_s < 0 ? "−" : "+"}${Math.abs(clock.offset_s).toFixed(2)} s`;
}

function factsOf(source, settings) {
  const facts = [
    ["State since", source.since === null ? DASH : formatTime(Date.parse(source.since))],
    ["Newest sample, by the device’s clock", source.last_sample_time === null ? DASH : formatTime(Date.parse(source.last_sample_time))],
    ["Error now", source.reason ?? "None"],
    ["Attempts that failed since the start", formatCount(source.n_failed)],
    ["Received: all good, some channel not good", `${formatCount(source.n_stored)}, ${formatCount(source.n_flagged)}`],
    ["Rejected", reasonsWords(source.rejected) || "None"],
    ["Sent twice, dropped", formatCount(source.n_repeated)],
    ["Restarts of the device", formatCount(source.n_restarts)],
    ["Clock drift", driftWords(source)],
    ["Wrong time stamps", source.clock ? formatCount(source.clock.n_stamp_faults) : DASH],
    ["Kind", sourceKindWords(source.kind)],
    ["Sampling", `${formatFixed(source.rate_hz, source.rate_hz % 1 ? 2 : 0)} per second and channel`],
    ["Asked every", source.poll_period_s === null ? "It sends by itself" : `${source.poll_period_s} s`],
    ["A poll takes", pollWords(source)],
  ];
  if (source.kind === "can") facts.push(["Frames not used", reasonsWords(source.refused_frames) || "None"]);
  if (settings) facts.push(["Address", addressWords(settings)], ["Identity", identityWords(settings)]);
  return facts;
}

function pollWords({ polls, poll_period_s: period }) {
  if (polls === null) return period === null ? "It is not asked" : "Not known yet";
  return `${durationWords(polls.newest_s)}, on average ${durationWords(polls.mean_s)}`;
}

const durationWords = (seconds) => (seconds < 1 ? `${formatFixed(1000 * seconds, 0)} ms` : `${formatFixed(seconds, 1)} s`);

function driftWords({ clock, kind }) {
  if (SAMPLED_WHEN_ASKED.includes(kind)) return "None: it is sampled when it is asked";
  if (!clock || clock.drift_ppm === null) return "Not known yet";
  const sign = clock.drift_ppm < 0 ? "−" : "+";
  return `${sign}${Math.abs(clock.drift_ppm).toFixed(1)} ± ${(1.96 * clock.drift_uncertainty_ppm).toFixed(1)} ppm`;
}

/** Terms stay, only changed text is written, which keeps a selection. */
function drawFacts(list, facts) {
  if (list.childElementCount !== facts.length) {
    list.replaceChildren(...facts.map(([term]) => element("div", {}, element("dt", {}, term), element("dd"))));
  }
  facts.forEach(([, words], n) => setText(list.children[n].lastChild, words));
}
