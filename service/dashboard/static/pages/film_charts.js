/** The baseline map, and stiffness against the condition that it was read under. */

import { askReadings } from "../api.js";
import { cellsOf, mapCaption, mapLayout, mapTraces } from "../charts/baseline_map.js";
import { AXES, conditionCaption, conditionLayout, conditionTraces, pointsOf } from "../charts/condition.js";
import { panel } from "../charts/panel.js";
import { element } from "../dom.js";
import { learningSentence } from "../film_words.js";
import { choice } from "../parts/choice.js";
import { poll } from "../poll.js";

const PERIOD_S = 60;
const DAY_S = 86400;
const MAX_POINTS = 1500;
const SPANS = [[7, "7 d"], [30, "30 d"], [365, "1 y"]];
const DIRECTIONS = [["x", "x"], ["y", "y"]];

/** Returns `{ node, update(film), learned(baselines, baseline), draw(view), close() }`. */
export function filmCharts(path) {
  const direction = choice("Direction", DIRECTIONS, "x", () => show());
  const span = choice("History", SPANS, 30, () => questions.again());
  const map = panel("Baseline map", "baseline-map");
  const plots = Object.keys(AXES).map((against) => [against, panel(titleOf(against), `against-${against}`)]);
  const boxes = [map, ...plots.map(([, box]) => box)];
  const known = { film: null, baselines: null, baseline: null, history: null, today: null, nowMs: null };
  let drawn = "";

  const questions = poll(async (signal) => {
    if (known.nowMs === null || !known.film?.is_watched) return;
    const [history, today] = await Promise.all([
      askReadings(path, known.nowMs, span.value() * DAY_S, MAX_POINTS, signal),
      askReadings(path, known.nowMs, DAY_S, MAX_POINTS, signal),
    ]);
    Object.assign(known, { history, today });
    await show();
  }, () => PERIOD_S, (failure) => plots.forEach(([, box]) => box.trouble(failure.message)));

  async function show() {
    await Promise.all([showMap(map, known, direction.value()), ...plots.map(([against, box]) => showPlot(box, known, against, direction.value(), span.words()))]);
  }

  function showIfNew(inputs) {
    const now = JSON.stringify(inputs);
    if (now === drawn) return;
    drawn = now;
    show().catch((failure) => {
      drawn = "";
      map.trouble(failure.message);
    });
  }

  return {
    node: element("div", { class: "charts" }, element("div", { class: "choices" }, direction.node, span.node), ...boxes.map((box) => box.node)),
    update(film) {
      const isFirst = known.film === null;
      known.film = film;
      if (isFirst) questions.again();
      showIfNew([film.condition?.cell, film.why_not, known.baseline?.about, known.baselines?.learning]);
    },
    learned(baselines, baseline) {
      Object.assign(known, { baselines, baseline });
      showIfNew([known.film?.condition?.cell, known.film?.why_not, baseline?.about, baselines.learning]);
    },
    draw(view) {
      const isFirst = known.nowMs === null && view.serviceTimeMs !== null;
      known.nowMs = view.serviceTimeMs;
      if (isFirst) questions.again();
      for (const box of boxes) box.draw(view.silenceS, view.current ? null : "service not reachable.");
    },
    close: questions.stop,
  };
}

const titleOf = (against) => `Stiffness against ${against === "eccentricity_ratio" ? "eccentricity" : "oil temperature"}`;

/** Why there is no baseline to draw, or null. */
function absence({ film, baselines, baseline }, direction) {
  if (film && !film.is_watched) return `This film is not watched: ${film.why_not}.`;
  if (film === null || baselines === null) return "Asking the service.";
  if (baseline === null) return `No baseline yet. ${learningSentence(baselines)}`;
  return baseline[direction] === null ? `Too few readings in ${direction} to learn from.` : null;
}

function learnedCells(known, direction) {
  return absence(known, direction) === null ? cellsOf(known.baseline[direction].cells) : [];
}

async function showMap(box, known, direction) {
  const why = absence(known, direction);
  if (why !== null) {
    box.explain(why);
    return;
  }
  const cells = learnedCells(known, direction);
  const current = known.film.condition?.cell ?? null;
  const { about, eccentricity_width: e, oil_temperature_width_c: c } = known.baseline;
  const caption = `Version ${about.version}, direction ${direction}. ${mapCaption(cells, current)}`;
  await box.show(mapTraces(cells, [e, c]), mapLayout(cells, current, `${about.version} ${direction}`), caption);
}

async function showPlot(box, known, against, direction, spanWords) {
  if (known.film && !known.film.is_watched) {
    box.explain(absence(known, direction));
    return;
  }
  if (known.history === null || known.today === null) return;
  const points = { cells: learnedCells(known, direction), history: pointsOf(known.history, direction), today: pointsOf(known.today, direction) };
  const traces = conditionTraces(points, against);
  if (traces.length === 0) {
    box.explain(`No settled reading in the last ${spanWords}, and no baseline yet. ${known.baselines ? learningSentence(known.baselines) : ""}`);
    return;
  }
  await box.show(traces, conditionLayout(against, `${against} ${direction}`, [...points.history, ...points.today][0]?.unit), conditionCaption(points, against, spanWords));
}
