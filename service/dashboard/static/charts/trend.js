/** A quantity against time: the band between smallest and largest, the mean as a line. */

import { formatTime, formatZone, kindOf } from "../format.js";
import { DOUBT_COLOUR, X_BAND, X_COLOUR, Y_BAND, Y_COLOUR, axis, baseLayout, curve, points } from "./style.js";

/** Half-width of the interval that holds 95 % of a normal distribution, over its standard deviation. */
const NORMAL_95 = 1.96;

const LOOKS = {
  x: { colour: X_COLOUR, band: X_BAND, dash: "solid" },
  y: { colour: Y_COLOUR, band: Y_BAND, dash: "dash" },
};

/**
 * Buckets of one series in pieces without interruption, scaled to the shown unit.
 *
 * Empty buckets are narrower than the refresh and mean nothing; a bucket without a value,
 * or a step wider than two and a half refreshes, is an interruption and is drawn as one.
 */
export function piecesOf(trends, name, refreshS) {
  const series = trends.series[name];
  const bucketS = trends.bucket_s ?? 0; // without buckets every reading stands alone
  const widestStepS = 2.5 * Math.max(bucketS, refreshS);
  const endS = Date.parse(trends.end) / 1000;
  const pieces = [];
  let piece = null;
  trends.time.forEach((startS, index) => {
    const timeS = Math.min(startS + bucketS / 2, endS);
    if (series.mean[index] === null) {
      if (series.count[index] > 0 || series.worst_level[index] === "bad") piece = null;
      return;
    }
    if (piece === null || timeS - piece.at(-1).timeS > widestStepS) pieces.push((piece = []));
    piece.push(bucketAt(series, index, timeS, kindOf(name).scale));
  });
  return pieces;
}

function bucketAt(series, index, timeS, scale) {
  return {
    timeS,
    minimum: series.minimum[index] / scale,
    maximum: series.maximum[index] / scale,
    mean: series.mean[index] / scale,
    random: series.u_random?.[index] == null ? null : (NORMAL_95 * series.u_random[index]) / scale,
    level: series.worst_level[index],
  };
}

const at = (bucket) => formatTime(bucket.timeS * 1000);

/** Traces for one series: the band, the mean, and the random uncertainty about it where it is known. */
export function trendTraces(pieces, name, label, axisLetter, changes = {}) {
  const look = { ...LOOKS[axisLetter], ...changes };
  return [bandTrace(pieces, look, label), ...randomTraces(pieces, look, label), meanTrace(pieces, look, name, label)];
}

const isKnown = (bucket) => bucket.random !== null;

/** Two fine dotted lines, distinct from the band of readings. */
function randomTraces(pieces, look, label) {
  const known = pieces.map((piece) => piece.filter(isKnown)).filter((piece) => piece.length > 0);
  if (known.length === 0) return [];
  const edge = (sign) => (piece) => [
    ...piece.map((bucket) => [at(bucket), bucket.mean + sign * bucket.random]),
    [null, null],
  ];
  return [
    curve(...columns([...known.flatMap(edge(1)), ...known.flatMap(edge(-1))]), {
      line: { color: look.colour, width: 1, dash: "dot" },
      connectgaps: false,
      hoverinfo: "skip",
      legendgroup: label,
      showlegend: false,
      meta: "random",
    }),
  ];
}

function bandTrace(pieces, look, label) {
  const outline = (piece) => [
    ...piece.map((bucket) => [at(bucket), bucket.maximum]),
    ...piece.toReversed().map((bucket) => [at(bucket), bucket.minimum]),
    [null, null], // ends the closed shape, so that no band spans an interruption
  ];
  return curve(...columns(pieces.flatMap(outline)), {
    fill: "toself",
    fillcolor: look.band,
    line: { width: 0 },
    hoverinfo: "skip",
    legendgroup: label,
    showlegend: false,
  });
}

function meanTrace(pieces, look, name, label) {
  const kind = kindOf(name);
  const means = pieces.flatMap((piece) => [...piece.map((bucket) => [at(bucket), bucket.mean]), [null, null]]);
  return curve(...columns(means), {
    mode: pieces.some((piece) => piece.length === 1) ? "lines+markers" : "lines",
    name: label,
    legendgroup: label,
    line: { color: look.colour, width: 1.8, dash: look.dash },
    marker: { color: look.colour, size: 4 },
    connectgaps: false,
    hovertemplate: `${label}: %{y:.${kind.decimals}f} ${kind.unit}<extra></extra>`,
  });
}

/** Triangles along the foot of the chart wherever one of the series is to be doubted. */
export function doubtTrace(allPieces) {
  const doubted = new Set(allPieces.flat(2).filter((bucket) => bucket.level !== "good").map(at));
  const times = [...doubted].sort();
  return points(times, times.map(() => 0.015), {
    yaxis: "y2",
    name: "uncertain",
    marker: { symbol: "triangle-up", size: 8, color: DOUBT_COLOUR },
    hoverinfo: "skip",
    showlegend: times.length > 0,
  });
}

const columns = (pairs) => [0, 1].map((n) => pairs.map((pair) => pair[n]));

/** A sentence on what of a trend was simulated, not measured on the machine; empty if nothing was. */
export function simulatedSentence(trends) {
  if (trends.simulated_until == null) return "";
  return ` Up to ${formatTime(Date.parse(trends.simulated_until))} the values are simulated, not measured.`;
}

/** Layout with the whole asked-for span on the time axis, however little of it has data. */
export function trendLayout(trends, title, revision, valueRange) {
  const [start, end] = [trends.start, trends.end].map((time) => Date.parse(time));
  return baseLayout(revision, {
    xaxis: axis(`Local time, ${formatZone(end)}`, { type: "date", range: [formatTime(start), formatTime(end)], hoverformat: "%Y-%m-%d %H:%M:%S" }),
    yaxis: axis(title, { range: valueRange }),
    yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true },
    hovermode: "x unified",
    margin: { l: 56, r: 12, t: 8, b: 56 },
  });
}

/** Uncertain values set the axis up to this share of a value beyond the good ones, or up to their spread. */
const REACH = 0.25;

/**
 * From the smallest to the largest value that sets the axis: good ones, and uncertain ones that are not far from these.
 *
 * `beside` are traces drawn with the curves that must be seen, too; `fromZero` begins at zero.
 */
export function valueRange(allPieces, beside = [], fromZero = false) {
  const all = allPieces.flat(2);
  const good = all.filter(({ level }) => level === "good");
  const [least, most] = endsOf((good.length ? good : all).flatMap(({ minimum, maximum }) => [minimum, maximum]));
  const reach = Math.max(most - least, REACH * Math.max(Math.abs(least), Math.abs(most)));
  const near = all.map(({ mean }) => mean).filter((mean) => mean > least - reach && mean < most + reach);
  const levels = beside.filter(({ name }) => name !== "danger limit").flatMap(({ y }) => y.filter((gn) => gn !== null));
  const [low, high] = endsOf([least, most, ...near, ...levels]);
  const margin = 0.08 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [fromZero ? Math.min(low, 0) : low - margin, high + margin];
}

/** How many values lie beyond the axis. */
export const nOutside = (allPieces, [low, high]) => allPieces.flat(2).filter(({ mean }) => mean < low || mean > high).length;

const RANDOM_WORDS =
  " Dotted: random uncertainty of a result, 95 %; what transducers and bracket add stays the same and is left out.";

/** From when to when there are data. */
export function spanCaption(allPieces) {
  const [from, to] = endsOf(allPieces.flat(2).map((bucket) => bucket.timeS * 1000)).map(formatTime);
  return `Data from ${from} to ${to}.`;
}

/** From when to when there are data, and how to read the chart. */
export function trendCaption(allPieces, nBeyond) {
  const random = allPieces.flat(2).some(isKnown) ? RANDOM_WORDS : "";
  const outside = nBeyond === 0 ? "" : ` ${nBeyond} uncertain value${nBeyond === 1 ? " lies" : "s lie"} outside the axis.`;
  return `${spanCaption(allPieces)} Band: smallest to largest; line: mean.${random}${outside}`;
}

const endsOf = (numbers) => [numbers.reduce((a, b) => Math.min(a, b)), numbers.reduce((a, b) => Math.max(a, b))];
