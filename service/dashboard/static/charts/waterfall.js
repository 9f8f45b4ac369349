/** Spectra over time: as a map whose darkness is the amplitude, or as lines one behind the other. */

import { amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { colourOf } from "../theme.js";
import { DOUBT_COLOUR, INK, MARK, PLOT, axis, baseLayout, points } from "./style.js";
import { localMs, withHoles } from "./waterfall_rows.js";
import { contrastOf, scaleOf } from "./waterfall_scale.js";

/** Most lines one behind the other; more could not be told apart. */
const MOST_LINES = 60;

/** Of the time that is shown, how far the largest amplitude of a line reaches up. */
const REACH = 0.16;

/** A map; every cell is one spectrum's line. */
export function mapTraces(drawn) {
  const rows = withHoles(drawn.rows);
  const scale = contrastOf(drawn);
  const shades = ["--plot", "--chart-x", "--ink"].map(colourOf);
  const ticks = ticksOf(scale, drawn.isLog);
  return [
    {
      type: "heatmap",
      x: drawn.abscissa,
      y: rows.map(({ timeS }) => localMs(timeS)),
      z: rows.map(({ amplitude }) => drawn.abscissa.map((_, n) => (amplitude ? scale.of(amplitude[n]) : null))),
      zmin: scale.low,
      zmax: scale.high,
      colorscale: shades.map((shade, n) => [n / 2, shade]),
      colorbar: { thickness: 12, outlinewidth: 0, title: { text: amplitudeUnit(), side: "right" }, ...ticks },
      hoverongaps: false,
      customdata: rows.map(({ amplitude }) => drawn.abscissa.map((_, n) => (amplitude ? shownAmplitude(amplitude[n]) : null))),
      hovertemplate: `%{customdata:.3~g} ${amplitudeUnit()} at %{x:.4~g} ${drawn.axis.unit}<br>%{y|%Y-%m-%d %H:%M:%S}<extra></extra>`,
    },
  ];
}

/** Even steps, written as the amplitudes they stand for. */
function ticksOf({ low, high }, isLog) {
  if (!isLog) return {};
  const steps = Array.from({ length: 5 }, (_, n) => low + (n / 4) * (high - low));
  return { tickvals: steps, ticktext: steps.map((step) => String(Number((10 ** step).toPrecision(2)))) };
}

/** Lines one behind the other, the newest the farthest; each hides what is behind it. */
export function lineTraces(drawn) {
  const rows = evenly(drawn.rows.filter(({ amplitude }) => amplitude), MOST_LINES);
  const scale = scaleOf(drawn);
  const spanMs = (rows.at(-1).timeS - rows[0].timeS) * 1000 || 60_000;
  const height = (um) => Math.max(((scale.of(um) ?? scale.low) - scale.low) / (scale.high - scale.low), 0);
  const [first, last] = [drawn.abscissa[0], drawn.abscissa.at(-1)];
  const common = { type: "scatter", mode: "lines", showlegend: false, hoverinfo: "skip" };
  return rows.toReversed().flatMap((row) => {
    const foot = localMs(row.timeS);
    const y = row.amplitude.map((um) => (um === null ? foot : foot + REACH * spanMs * height(um)));
    return [
      { ...common, x: [first, ...drawn.abscissa, last], y: [foot, ...y, foot], fill: "toself", fillcolor: PLOT, line: { width: 0 } },
      { ...common, x: drawn.abscissa, y, line: { color: INK, width: 1 } },
    ];
  });
}

/** Of too many, evenly chosen ones, the newest among them. */
function evenly(rows, most) {
  if (rows.length <= most) return rows;
  return Array.from({ length: most }, (_, n) => rows[Math.round((n * (rows.length - 1)) / (most - 1))]);
}

/** How many of the rows are drawn as lines. */
export const nLines = (rows) => Math.min(rows.filter(({ amplitude }) => amplitude).length, MOST_LINES);

/** Where 1× and the vortex were read, over the picture. */
export function markTraces({ rows, axis: along }) {
  const known = withHoles(rows);
  const lines = [["1×", "dot", (row) => row.order1Hz], ["vortex", "dash", (row) => row.order1Hz && row.vortexHz]];
  const common = { type: "scatter", mode: "lines", connectgaps: false, hoverinfo: "skip", y: known.map(({ timeS }) => localMs(timeS)) };
  return lines.map(([name, dash, of]) => ({
    ...common,
    x: known.map((row) => (of(row) ? along.of(of(row), row.order1Hz) : null)),
    line: { color: MARK, width: 1.6, dash },
    name,
  }));
}

/** Where alarms of the bearing were raised, as triangles along the right edge. */
export function alarmTraces(alarms, toUpper) {
  if (alarms.length === 0) return [];
  return [
    points(alarms.map(() => toUpper), alarms.map(({ timeS }) => localMs(timeS)), {
      name: "alarm raised",
      text: alarms.map(({ words }) => words),
      marker: { symbol: "triangle-left", size: 12, color: DOUBT_COLOUR, line: { color: INK, width: 1 } },
      cliponaxis: false,
      hovertemplate: "%{text}<br>%{y|%Y-%m-%d %H:%M:%S}<extra></extra>",
    }),
  ];
}

/** `moment` is the time of the spectrum that is shown beside it, or null. */
export function waterfallLayout({ axis: along, toUpper, startS, endS, headroom, revision }, momentS) {
  const marked = momentS === null ? [] : [localMs(momentS)];
  const spare = headroom ? REACH * (endS - startS) : 0;
  return baseLayout(revision, {
    xaxis: axis(along.title, { range: [0, toUpper] }),
    yaxis: axis("", { type: "date", range: [localMs(startS), localMs(endS + spare)] }),
    hovermode: "closest",
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemwidth: 44 },
    margin: { l: 100, r: 12, t: 8, b: 40 },
    shapes: marked.map((y) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { color: DOUBT_COLOUR, width: 2 } })),
  });
}
