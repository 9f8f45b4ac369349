/** One generating unit: how it runs, what is wrong, and its bearings side by side. */

import { ask } from "../api.js";
import { element } from "../dom.js";
import { unitAlarms } from "../parts/alarm_brief.js";
import { recordingsBrief } from "../parts/recordings_brief.js";
import { poll } from "../poll.js";
import { unitHead } from "./unit_head.js";
import { unitTable } from "./unit_table.js";

const FILM_PERIOD_S = 5;

/** Returns `{ draw(view), close() }`. */
export function unitPage(main, unitId) {
  const missing = element("p", { class: "sentence" });
  const content = element("div", { class: "unit-page", hidden: "" });
  main.append(missing, content);
  let parts = null;
  let bearings = [];
  const films = new Map();

  const questions = poll(async (signal) => {
    for (const bearing of bearings) films.set(bearing, await filmOf(unitId, bearing, signal));
  }, () => FILM_PERIOD_S);

  function build(unit) {
    bearings = unit.bearings.map(({ bearing }) => bearing);
    parts = [unitHead(unitId), unitAlarms(unitId), recordingsBrief(unitId), unitTable(unit)];
    content.replaceChildren(...parts.map((part) => part.node));
    questions.again();
  }

  return {
    draw(view) {
      const unit = view.units.find((one) => one.id === unitId);
      const isWhole = unit?.bearings.every((bearing) => bearing.isWhole) ?? false;
      content.hidden = !isWhole;
      missing.hidden = isWhole;
      if (!isWhole) missing.replaceChildren(missingSentence(view, unit, unitId), " ", element("a", { href: "#/" }, "Overview"));
      else if (parts === null) build(unit);
      if (isWhole) for (const part of parts) part.draw(unit, view, films);
    },
    close() {
      questions.stop();
      for (const part of parts ?? []) part.close?.();
    },
  };
}

/** Film of a bearing; null if the request fails, since the overview still shows its verdict. */
async function filmOf(unit, bearing, signal) {
  try {
    return await ask(["units", unit, "bearings", bearing, "film"], [], signal);
  } catch (failure) {
    if (signal.aborted) throw failure;
    return null;
  }
}

function missingSentence(view, unit, unitId) {
  if (view.silenceS === null) return "No numbers yet: the service has not answered.";
  if (unit) return "Asking the service.";
  return `This plant has no unit ${unitId}.`;
}
