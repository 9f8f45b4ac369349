/** The quiet look all charts share: greys, x solid and dark, y dashed and brown. */

const INK = "#22282c";
const GRID = "#d3d3cf";

export const X_COLOUR = "#1d4a73";
export const Y_COLOUR = "#8a5a13";
export const X_BAND = "rgba(29, 74, 115, 0.18)";
export const Y_BAND = "rgba(138, 90, 19, 0.18)";
export const DOUBT_COLOUR = "#b07a00";
export const FAINT = "#8b9094";
export { INK };

/** Layout common to all; `uirevision` keeps a zoom across redraws until it changes. */
export function baseLayout(uirevision, changes = {}) {
  return {
    uirevision,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "#fafaf8",
    font: { family: "system-ui, sans-serif", size: 12, color: INK },
    margin: { l: 56, r: 12, t: 8, b: 40 },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemwidth: 44 },
    hoverlabel: { bgcolor: "#ffffff", font: { color: INK } },
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
    zerolinecolor: "#b5b5b0",
    ticks: "outside",
    tickcolor: FAINT,
    ...changes,
  };
}

export const CONFIG = {
  responsive: true,
  displaylogo: false,
  displayModeBar: false,
  doubleClick: "reset",
};
