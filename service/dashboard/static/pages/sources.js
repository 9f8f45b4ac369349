/** Where all samples come from: every unit's device, how its samples arrive, the worst first. */

import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { CURRENT_LIMIT_S, ageAt, moment, secondsBetween } from "../live.js";
import { listing } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { poll } from "../poll.js";
import { serviceTimeMs } from "../server_time.js";
import { isAboutSamples, rejected, troubleOf } from "../source_words.js";
import { HEADS, sourceRow } from "./source_row.js";

const PERIOD_S = 2;
const LOSS_SPAN_MS = 60_000;

const READING_HELP =
  "Samples are counted per channel since the service started; what is missing never arrived, what is rejected arrived and could not be used. " +
  "Lag: how far the newest sample is behind this service’s clock. Device clock: how far it is ahead of it. " +
  "Poll: last response time of the device.";

/** Returns `{ draw(view), close() }`. */
export function sourcesPage(main) {
  const state = mark();
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const table = listing("Sources, the worst first", HEADS, "The plant file names no units.", ({ source }) => source.unit, sourceRow);
  const head = element("div", { class: "page-head" }, element("h1", {}, "Source health"), state.node);
  const help = element("p", { class: "help" }, READING_HELP);
  main.append(head, sentence, element("section", { class: "panel listing sources" }, table.node, help));
  const lost = losses();
  let known = null;
  let failure = null;

  const questions = poll(async (signal) => {
    const [sources, { alarms }] = await Promise.all([ask(["sources"], [], signal), ask(["alarms"], [], signal)]);
    const settings = known?.settings ?? (await settingsOf(signal));
    known = { sources, alarms, settings, receivedAt: moment(), lost: sources.map(lost.of) };
    failure = null;
  }, () => PERIOD_S, (error) => (failure = error.message));

  function drawState() {
    const silenceS = known && secondsBetween(known.receivedAt, moment());
    const current = known !== null && silenceS <= CURRENT_LIMIT_S;
    state.node.hidden = failure === null && (current || known === null);
    state.draw("bad", known ? `This list is ${formatAge(silenceS)} old: how samples arrive now is not known. ${failure ?? ""}` : failure);
    table.setCurrent(current);
  }

  return {
    draw() {
      drawState();
      if (known === null) return;
      const judged = judgedSources(known, serviceTimeMs());
      table.draw(judged);
      setText(sentence, countSentence(judged));
    },
    close: questions.stop,
  };
}

/** Where devices are and who they must be, by unit. Without it the rest is shown all the same. */
async function settingsOf(signal) {
  try {
    const { settings } = await ask(["configuration"], [], signal);
    return new Map(settings.unit.map((unit) => [unit.id, unit]));
  } catch (failure) {
    if (signal.aborted) throw failure;
    return null;
  }
}

/** Every source with what is worst about it now, the worst first. */
function judgedSources({ sources, alarms, settings, lost }, nowMs) {
  const judged = sources.map((told, n) => {
    const source = { ...told, data_age_s: ageAt(told.received, nowMs) };
    const mine = alarms.filter((alarm) => isAboutSamples(alarm, source.unit));
    const unit = settings?.get(source.unit);
    const trouble = troubleOf(source, mine, lost[n]);
    return { source, trouble, settings: unit?.source ?? null, name: unit?.name ?? source.unit, nowMs };
  });
  return judged.sort((one, other) => one.trouble.rank - other.trouble.rank);
}

function countSentence(judged) {
  if (judged.length === 0) return "";
  const wrong = judged.filter(({ trouble }) => ["bad", "uncertain"].includes(trouble.look)).length;
  const connected = judged.filter(({ source }) => source.state === "connected").length;
  const rest = wrong === 0 ? "Nothing is wrong with any of them." : `Something is wrong with ${wrong}: see ${wrong === 1 ? "the first line" : "the first lines"}.`;
  return `${connected} of ${judged.length} connected. ${rest}`;
}

/** Returns `{ of(source) }`: samples missing or rejected in the last minute that this page has seen; counts are since the start. */
function losses() {
  const seen = new Map();
  return {
    of(source) {
      const now = performance.now();
      const count = source.n_gap + rejected(source);
      const earlier = (seen.get(source.unit) ?? []).filter(({ at, total }) => at >= now - LOSS_SPAN_MS && total <= count);
      seen.set(source.unit, [...earlier, { at: now, total: count }]);
      return earlier.length ? count - earlier[0].total : 0;
    },
  };
}
