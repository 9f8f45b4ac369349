/** Change of the stiffness of a film against time, with its limits. */

import { askReadings } from "../api.js";
import { panel } from "../charts/panel.js";
import { X_COLOUR, Y_COLOUR, axis, baseLayout } from "../charts/style.js";
import { limitWords } from "../film_words.js";
import { formatTime } from "../format.js";
import { choice } from "../parts/choice.js";
import { poll } from "../poll.js";
import { serviceTimeMs } from "../server_time.js";

const PERIOD_S = 15;
const MAX_POINTS = 500;
const SPANS = [[3600, "1 h"], [8 * 3600, "8 h"], [86400, "1 d"], [30 * 86400, "30 d"]];
const LOOKS = { x: { color: X_COLOUR, width: 1.8 }, y: { color: Y_COLOUR, width: 1.8, dash: "dash" } };

/** Returns `{ node, update(film), draw(latest, unit, view), close() }`. */
export function changeChart(path) {
  let film = null;
  const span = choice("Span", SPANS, 8 * 3600, () => questions.again());
  const box = panel("Change of film stiffness against the baseline", "change", span.node);
  const questions = poll(async (signal) => {
    if (film === null) return;
    if (!film.is_watched) return box.explain(`This film is not watched: ${film.why_not}.`);
    const readings = await askReadings(path, serviceTimeMs(), span.value(), MAX_POINTS, signal);
    await show(box, film.limits, readings, span.words());
  }, () => PERIOD_S, (failure) => box.trouble(failure.message));
  return {
    node: box.node,
    update(found) {
      const isFirst = film === null;
      film = found;
      if (isFirst) questions.again();
    },
    draw: (latest, unit, view) => box.draw(view.silenceS, view.current ? null : "service not reachable."),
    close: questions.stop,
  };
}

async function show(box, limits, readings, words) {
  const known = ["x", "y"].flatMap((direction) => readings[direction].deviation_percent.filter((one) => one !== null));
  if (known.length === 0) {
    box.explain(`No reading of the last ${words} was compared with a baseline.`);
    return;
  }
  const times = readings.time.map((timeS) => formatTime(timeS * 1000));
  const first = readings.time.findIndex((_, n) => readings.x.deviation_percent[n] !== null || readings.y.deviation_percent[n] !== null);
  const traces = Object.entries(LOOKS).map(([name, line]) => ({
    ...{ name, line, x: times, y: readings[name].deviation_percent, type: "scatter", mode: "lines+markers" },
    ...{ marker: { color: line.color, size: 4 }, hovertemplate: `${name}: %{y:+.1f} %<extra></extra>` },
  }));
  const caption = `A point: one reading against what the baseline expects under its condition. ${limitWords(limits)}.`;
  await box.show(traces, layoutOf(limits, known, [times[first], times.at(-1)], words), caption);
}

/** Softening to beyond the limit of danger is always in the picture. */
function layoutOf({ alert_percent: alert, danger_percent: danger }, known, range, words) {
  const lines = [[alert, "alert", "var(--chart-doubt)", "dot"], [danger, "danger", "var(--bad)", "dash"]].flatMap(([at, name, color, dash]) =>
    [-at, at].map((percent) => ({ percent, name, line: { color, dash, width: 1.5 } })),
  );
  const [low, high] = [Math.min(-1.3 * danger, ...known.map((one) => one - 2)), Math.max(2 * alert, ...known.map((one) => one + 2))];
  const shown = lines.filter(({ percent }) => percent < high);
  return baseLayout(words, {
    xaxis: axis("", { type: "date", range, hoverformat: "%Y-%m-%d %H:%M:%S" }),
    yaxis: axis("% of expected", { range: [low, high] }),
    shapes: shown.map(({ percent, line }) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: percent, y1: percent, line })),
    annotations: shown.map(({ percent, name }) => ({ xref: "paper", x: 0, xanchor: "left", y: percent, yanchor: "bottom", text: name, showarrow: false, font: { size: 11 } })),
    hovermode: "x unified",
  });
}
