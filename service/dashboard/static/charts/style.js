/**
 * The quiet look all charts share: greys, x solid and dark, y dashed and brown.
 *
 * Colours are named here as custom properties of base.css; `coloured` puts in what they are just now,
 * light or dark. `panel` does so itself whenever it draws, and again when light turns dark.
 */

import { colourOf } from "../theme.js";

export const INK = "var(--ink)";
export const X_COLOUR = "var(--chart-x)";
export const Y_COLOUR = "var(--chart-y)";
export const X_BAND = "var(--chart-x-band)";
export const Y_BAND = "var(--chart-y-band)";
export const DOUBT_COLOUR = "var(--chart-doubt)";
export const FAINT = "var(--chart-faint)";
/** Marks over a map, whether it is light or dark there. */
export const MARK = "var(--chart-mark)";
export const PLOT = "var(--plot)";
const GRID = "var(--chart-grid)";

/** Lines of a chart that compares more than two, in this order; each needs a dash or a marker of its own too. */
export const SERIES = Array.from({ length: 8 }, (_, n) => `var(--series-${n + 1})`);

const NAMED = /^var\((--[a-z0-9-]+)\)$/;

/** Traces or a layout with the present colours in place of their names; columns of numbers stay as they are. */
export function coloured(value) {
  if (typeof value === "string") return NAMED.test(value) ? colourOf(NAMED.exec(value)[1]) : value;
  if (Array.isArray(value)) return typeof value[0] === "number" ? value : value.map(coloured);
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value) || value instanceof Date) return value;
  return Object.fromEntries(Object.entries(value).map(([name, one]) => [name, coloured(one)]));
}

/** Layout common to all; `uirevision` keeps a zoom across redraws until it changes. */
export function baseLayout(uirevision, changes = {}) {
  return {
    uirevision,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: PLOT,
    font: { family: "system-ui, sans-serif", size: 12, color: INK },
    margin: { l: 56, r: 12, t: 8, b: 40 },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemwidth: 44 },
    hoverlabel: { bgcolor: PLOT, bordercolor: FAINT, font: { color: INK } },
    dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom",
    ...changes,
  };
}

/** An axis with title and grid. */
export function axis(title, changes = {}) {
  return {
    title: { text: title, standoff: 6 },
    gridcolor: GRID,
    linecolor: FAINT,
    zerolinecolor: "var(--chart-zero)",
    ticks: "outside",
    tickcolor: FAINT,
    ...changes,
  };
}

/** A trace of a line; `looks` are other settings of the trace. */
export const curve = (x, y, looks) => ({ type: "scatter", mode: "lines", x, y, ...looks });

/** A trace of single points. */
export const points = (x, y, looks) => ({ type: "scatter", mode: "markers", x, y, ...looks });

export const CONFIG = {
  responsive: true,
  displaylogo: false,
  displayModeBar: false,
  doubleClick: "reset",
};
