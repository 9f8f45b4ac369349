/** Where all samples come from: every unit's device, how its samples arrive, the worst first. */

import { NotReachable, ask } from "../api.js";
import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { CURRENT_LIMIT_S, moment, secondsBetween } from "../live.js";
import { losses } from "../parts/losses.js";
import { mark } from "../parts/mark.js";
import { poll } from "../poll.js";
import { isAboutSamples, troubleOf } from "../source_words.js";
import { HEADS, sourceRow } from "./source_row.js";

const PERIOD_S = 2;

/** Returns `{ draw(view), close() }`. */
export function sourcesPage(main) {
  const state = mark();
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const table = sourceTable();
  const head = element("div", { class: "page-head" }, element("h1", {}, "Source health"), state.node);
  main.append(head, sentence, element("section", { class: "panel listing sources" }, table.node, element("p", { class: "help" }, READING_HELP)));
  const lost = losses();
  let heard = null;
  let failure = null;
  let settings = null;

  const questions = poll(async (signal) => {
    try {
      const [sources, { time, alarms }] = await Promise.all([ask(["sources"], [], signal), ask(["alarms"], [], signal)]);
      settings ??= await settingsOf(signal);
      [heard, failure] = [moment(), null];
      const judged = sources.map((source) => judgedSource(source, alarms, lost.of(source), settings));
      judged.sort((one, other) => one.trouble.rank - other.trouble.rank || sources.indexOf(one.source) - sources.indexOf(other.source));
      table.draw(judged, Date.parse(time));
      setText(sentence, countSentence(judged));
    } catch (error) {
      if (signal.aborted) return;
      failure = error instanceof NotReachable ? `Service not reachable. ${error.message}` : error.message;
    }
    drawState();
  }, () => PERIOD_S);

  function drawState() {
    const silenceS = heard ? secondsBetween(heard, moment()) : null;
    const current = silenceS !== null && silenceS <= CURRENT_LIMIT_S;
    state.node.hidden = current && failure === null;
    if (heard === null) setText(sentence, failure ?? "Asking the service.");
    state.draw("bad", silenceS === null ? "Nothing is known yet." : `This list is ${formatAge(silenceS)} old: how samples arrive now is not known. ${failure ?? ""}`);
    table.setCurrent(current);
  }

  return { draw: drawState, close: questions.stop };
}

const READING_HELP =
  "Samples are counted per channel since the service started; what is missing never arrived, what is rejected arrived and could not be used. " +
  "Lag: how far the newest sample is behind this service’s clock. Device clock: how far it is ahead of it.";

/** Where devices are and who they must be; a name for each unit. Without it the rest is shown all the same. */
async function settingsOf(signal) {
  try {
    const { settings } = await ask(["configuration"], [], signal);
    return new Map(settings.unit.map((unit) => [unit.id, unit]));
  } catch (failure) {
    if (signal.aborted) throw failure;
    return null;
  }
}

function judgedSource(source, alarms, lost, settings) {
  const mine = alarms.filter((alarm) => isAboutSamples(alarm, source.unit));
  const unit = settings?.get(source.unit);
  return { source, trouble: troubleOf(source, mine, lost), settings: unit?.source ?? null, name: unit?.name ?? source.unit };
}

function sourceTable() {
  const heads = HEADS.map((head) => element("th", { scope: "col", role: "columnheader" }, head));
  const body = element("tbody", { role: "rowgroup" });
  const table = element("table", { role: "table", "aria-label": "Sources, the worst first", hidden: "" }, element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...heads)), body);
  const rows = new Map();
  return {
    node: table,
    draw(judged, nowMs) {
      table.hidden = judged.length === 0;
      judged.forEach((found, place) => {
        const { unit } = found.source;
        const row = rows.get(unit) ?? rows.set(unit, sourceRow(unit, found.name)).get(unit);
        if (body.children[2 * place] !== row.nodes[0]) row.nodes.forEach((node, n) => body.insertBefore(node, body.children[2 * place + n] ?? null));
        row.draw(found, nowMs);
      });
    },
    setCurrent: (current) => table.setAttribute("data-current", String(current)),
  };
}

function countSentence(judged) {
  if (judged.length === 0) return "The plant file names no units.";
  const n = (wanted) => judged.filter(({ trouble }) => trouble.look === wanted).length;
  const connected = judged.filter(({ source }) => source.state === "connected").length;
  const wrong = n("bad") + n("uncertain");
  const rest = wrong === 0 ? "Nothing is wrong with any of them." : `Something is wrong with ${wrong}: see ${wrong === 1 ? "the first line" : "the first lines"}.`;
  return `${connected} of ${judged.length} connected. ${rest}`;
}
