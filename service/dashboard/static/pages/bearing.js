/** One bearing: its numbers large, its charts, and what they rest on. */

import { bearingCharts } from "./bearing_charts.js";
import { bearingNumbers } from "./bearing_numbers.js";
import { element, setText } from "../dom.js";
import { formatAge, formatTime } from "../format.js";
import { drawQuality, mark } from "../parts/mark.js";
import { sourceView } from "../parts/source.js";
import { linkTo } from "../parts/ways.js";
import { bearingAddress } from "../route.js";
import { qualityOf, reasonSentence } from "../words.js";
import { bearingHead } from "./bearing_head.js";
import { estimatorTable } from "./estimator_table.js";
import { filmMatrices } from "./film_matrices.js";
import { filmSummary } from "./film_summary.js";
import { windowFacts } from "./window_facts.js";

/** Returns `{ draw(view), close() }`. */
export function bearingPage(main, unitId, bearingId) {
  const missing = element("p", { class: "sentence" });
  const content = element("div", { class: "bearing", hidden: "" });
  main.append(missing, content);
  const path = ["units", unitId, "bearings", bearingId];
  const summary = filmSummary(path, unitId, bearingId);
  const numbers = [bearingNumbers(path), summary, estimatorTable(path), filmMatrices(path)];
  const parts = [headPart(unitId, bearingId), ...numbers, bearingCharts(path), windowFacts()];
  content.append(...parts.map((part) => part.node));
  return {
    draw(view) {
      const unit = view.units.find((one) => one.id === unitId);
      const latest = unit?.bearings.find((one) => one.bearing === bearingId && one.isWhole);
      content.hidden = !latest;
      missing.hidden = Boolean(latest);
      if (latest) for (const part of parts) part.draw(latest, unit, view);
      else missing.replaceChildren(missingSentence(view, unit, unitId, bearingId), " ", linkTo("#/", "Overview"));
    },
    close() {
      for (const part of parts) part.close?.();
    },
  };
}

function missingSentence(view, unit, unitId, bearingId) {
  if (view.silenceS === null) return "No numbers yet: the service has not answered.";
  if (unit?.bearings.some(({ bearing }) => bearing === bearingId)) return "Asking the service.";
  return `This plant has no bearing ${bearingId} on a unit ${unitId}.`;
}

/** Where we are, how good it is, how old it is. */
function headPart(unitId, bearingId) {
  const quality = mark();
  const why = element("span", { class: "why-sentence" });
  const age = element("span", { class: "data-age" });
  const source = sourceView();
  const state = element("div", { class: "state" }, quality.node, why, age);
  const head = bearingHead(unitId, bearingId, "", bearingAddress, state, source.node);
  return {
    node: head.node,
    draw(latest, unit, view) {
      head.draw(view);
      const whole = qualityOf(latest);
      drawQuality(quality, whole);
      setText(why, whole.level === "good" ? "" : reasonSentence(whole.reason));
      setText(age, windowAge(latest));
      source.draw(unit.source);
    },
  };
}

function windowAge(latest) {
  if (latest.age_s === null) return "No segment has been analysed yet.";
  return `Newest result ${formatAge(latest.age_s)} old, samples up to ${formatTime(Date.parse(latest.time))}`;
}
