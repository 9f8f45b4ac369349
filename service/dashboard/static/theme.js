/** Light or dark: as set in the system, or as chosen in this browser. */

import { keep, kept } from "./kept.js";

const KEY = "padwatch-theme";
const CHANGED = "padwatch-theme";

/** Value and words of each choice; the first is what a new browser shows. */
export const THEMES = [["system", "System"], ["light", "Light"], ["dark", "Dark"]];

const systemIsDark = matchMedia("(prefers-color-scheme: dark)");
let chosen = kept(KEY, THEMES.map(([value]) => value));

/** What is chosen: `system`, `light` or `dark`. */
export const theme = () => chosen;

/** Choose and remember; charts hear `padwatch-theme`. */
export function chooseTheme(choice) {
  chosen = choice;
  keep(KEY, choice);
  show();
}

/** Call `redraw` whenever light turns dark or dark light. Returns what stops that. */
export function onTheme(redraw) {
  window.addEventListener(CHANGED, redraw);
  return () => window.removeEventListener(CHANGED, redraw);
}

/** The colour that a custom property has just now, as `rgb(…)`: what canvases and charts need. */
export function colourOf(property) {
  probe.style.color = `var(${property})`;
  return getComputedStyle(probe).color;
}

function show() {
  const isDark = chosen === "system" ? systemIsDark.matches : chosen === "dark";
  document.documentElement.dataset.theme = isDark ? "dark" : "light";
  window.dispatchEvent(new Event(CHANGED));
}

const probe = document.createElement("span");
probe.hidden = true;
document.body.append(probe);
systemIsDark.addEventListener("change", show);
show();
