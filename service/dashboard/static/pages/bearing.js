/** One bearing: the verdict first, then stiffness and condition, then charts, then details. */

import { bearingCharts } from "./bearing_charts.js";
import { keyNumbers, moreNumbers } from "./bearing_numbers.js";
import { changeChart } from "./change_chart.js";
import { element, setText } from "../dom.js";
import { formatAge, formatTime } from "../format.js";
import { bearingAlarms } from "../parts/alarm_brief.js";
import { filmBrief } from "../parts/film_brief.js";
import { drawQuality, mark } from "../parts/mark.js";
import { sourceView } from "../parts/source.js";
import { openAlarms } from "../parts/unit_alarm_mark.js";
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
  const [head, key, change] = [headPart(unitId, bearingId), keyNumbers(path), changeChart(path)];
  const [summary, charts] = [filmSummary(path, unitId, bearingId, change.update), bearingCharts(path)];
  const alarms = bearingAlarms(unitId, bearingId);
  const details = [moreNumbers(path), estimatorTable(path), filmMatrices(path), windowFacts(), sourcePart()];
  const parts = [head, alarms, summary, key, change, charts, ...details];
  const first = element("div", { class: "first" }, element("div", { class: "column" }, summary.node, key.node), change.node);
  const folded = element("details", { class: "fold" }, element("summary", {}, "All numbers, estimators, averaged window and data source"), ...details.map((part) => part.node));
  content.append(head.node, alarms.node, first, charts.node, folded);
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

/** Where we are, the verdict, and how good and old the data are. */
function headPart(unitId, bearingId) {
  const alarms = openAlarms();
  const verdict = filmBrief();
  const quality = mark();
  const why = element("span", { class: "why-sentence" });
  const age = element("span", { class: "data-age" });
  const state = element("div", { class: "state" }, element("span", {}, "Data quality:"), quality.node, why, age);
  const source = sourceView();
  const head = bearingHead(unitId, bearingId, "", bearingAddress, verdict.node, state, source.node);
  return {
    node: head.node,
    draw(latest, unit, view) {
      head.draw(view);
      verdict.draw(unit.films[unit.bearings.indexOf(latest)], alarms.of(unitId, bearingId));
      const whole = qualityOf(latest);
      drawQuality(quality, whole);
      setText(why, whole.level === "good" ? "" : reasonSentence(whole.reason));
      setText(age, windowAge(latest));
      source.draw(unit.source);
      source.node.hidden = unit.source.state === "connected";
    },
    close: alarms.close,
  };
}

function sourcePart() {
  const source = sourceView();
  return { node: element("section", { class: "panel" }, element("h2", {}, "Data source"), source.node), draw: (latest, unit) => source.draw(unit.source) };
}

function windowAge(latest) {
  if (latest.age_s === null) return "No segment has been analysed yet.";
  return `Newest result ${formatAge(latest.age_s)} old, samples up to ${formatTime(Date.parse(latest.time))}`;
}
