/** The film of a bearing on its page: the verdict, and the way to its baseline. */

import { ask } from "../api.js";
import { element } from "../dom.js";
import { poll } from "../poll.js";
import { filmAddress } from "../route.js";
import { verdictPanel } from "./film_verdict.js";

const PERIOD_S = 5;

/** Returns `{ node, draw(), close() }`; `onAnswer` receives every answer. */
export function filmSummary(path, unit, bearing, onAnswer) {
  const link = element("a", { class: "more", href: filmAddress(unit, bearing) }, "Baseline, map and history");
  const panel = verdictPanel(link);
  const questions = askFilm(path, panel, onAnswer);
  return { node: panel.node, draw() {}, close: questions.stop };
}

/** Requests the film periodically; `onAnswer` receives every answer. */
export function askFilm(path, panel, onAnswer) {
  return poll(async (signal) => {
    const film = await ask([...path, "film"], [], signal);
    panel.draw(film);
    onAnswer(film);
  }, () => PERIOD_S, (failure) => panel.fail(failure.message));
}
