/** How a number is written, everywhere on the page: decimals, units, ages and times. */

import { amplitudeFactor, amplitudeUnit } from "./amplitudes.js";

/** Amplitudes of lines, shown zero-to-peak or peak-to-peak as the reader chose. */
const AMPLITUDE = /_um_pk$/;

const KINDS = [
  { name: /_of_kb$/, scale: 1, decimals: 3, unit: "k_b" },
  { name: /_of_kb_s$/, scale: 1e-3, decimals: 2, unit: "ms·k_b" },
  { name: /_n_per_m$/, scale: 1e9, decimals: 3, unit: "GN/m" },
  { name: /_n_s_per_m$/, scale: 1e6, decimals: 2, unit: "MN·s/m" },
  { name: /^overall_shaft_um_pk$/, scale: 1, decimals: 1, unit: "µm 0-pk" },
  { name: /_um_pp$/, scale: 1, decimals: 1, unit: "µm pk-pk" },
  { name: AMPLITUDE, scale: 1, decimals: 1, unit: "" },
  { name: /_um$/, scale: 1, decimals: 0, unit: "µm" },
  { name: /_mm_s_rms$/, scale: 1, decimals: 2, unit: "mm/s rms" },
  { name: /_rpm$/, scale: 1, decimals: 1, unit: "r/min" },
  { name: /_mw$/, scale: 1, decimals: 1, unit: "MW" },
  { name: /_c$/, scale: 1, decimals: 1, unit: "°C" },
  { name: /_k$/, scale: 1, decimals: 1, unit: "K" },
  { name: /_m$/, scale: 1, decimals: 1, unit: "m" },
  { name: /_percent$/, scale: 1, decimals: 1, unit: "%" },
  { name: /_a$/, scale: 1, decimals: 0, unit: "A" },
  { name: /_v$/, scale: 1, decimals: 0, unit: "V" },
  { name: /_deg$/, scale: 1, decimals: 0, unit: "°" },
  { name: /_hz$/, scale: 1, decimals: 3, unit: "Hz" },
  { name: /_coherence_/, scale: 1, decimals: 3, unit: "" },
  { name: /_ratio$|_lack_of_fit_|_roundness$/, scale: 1, decimals: 2, unit: "" },
  { name: /_n_lines$/, scale: 1, decimals: 0, unit: "" },
];

/** Scale, decimals and unit that a quantity is shown with; its name carries its unit. */
export function kindOf(quantity) {
  const kind = KINDS.find((candidate) => candidate.name.test(quantity));
  if (!kind) throw new Error(`no number format for the quantity ${quantity}`);
  return kind.name === AMPLITUDE ? { ...kind, scale: 1 / amplitudeFactor(), unit: amplitudeUnit() } : kind;
}

/** Stiffness in GN/m, or as a ratio to a bracket stiffness that is unknown: `{ value, unit }`. */
export function stiffnessShown(absolute, ratio) {
  if (ratio != null) return { value: ratio, unit: "k_b" };
  return { value: absolute == null ? null : absolute / 1e9, unit: "GN/m" };
}

/** Fixed decimals, a true minus sign, and no minus before a rounded zero. */
export function formatFixed(value, decimals) {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** The digits of a reading, without unit; `moreDecimals` for what is small beside it. */
export function formatQuantity(quantity, value, moreDecimals = 0) {
  const kind = kindOf(quantity);
  return formatFixed(value / kind.scale, kind.decimals + moreDecimals);
}

/** From a value to the farther end of its 95 % interval, in the digits of its quantity: ± 0.098. */
export function formatSpread(quantity, value, { low_95: low, high_95: high }) {
  return `± ${formatQuantity(quantity, Math.max(high - value, value - low))}`;
}

/** The 95 % interval in the digits of its quantity: 0.592 to 0.788. */
export function formatInterval(quantity, { low_95: low, high_95: high }) {
  return `${formatQuantity(quantity, low)} to ${formatQuantity(quantity, high)}`;
}

/** A number of any size that has no quantity's name: three digits that count. */
export function formatSignificant(value) {
  return value.toPrecision(3).replace(/e\+?(-?)(\d+)$/, "·10^$1$2").replaceAll("-", "−");
}

/** Whole numbers in groups of three: 1 234 567. */
export function formatCount(count) {
  return String(count).replace(/\B(?=(\d{3})+$)/g, " ");
}

const two = (number) => String(number).padStart(2, "0");

/** A duration in the two units that matter: 4 s, 2 min 05 s, 3 h 07 min, 12 d 4 h. */
export function formatAge(durationS) {
  const whole = Math.max(0, Math.floor(durationS));
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
  if (whole < 86400) return `${Math.floor(whole / 3600)} h ${two(Math.floor((whole % 3600) / 60))} min`;
  return `${Math.floor(whole / 86400)} d ${Math.floor((whole % 86400) / 3600)} h`;
}

/** Local date and time of the browser, `2026-07-01 03:12:45`; plotly reads it the same way. */
export function formatTime(timeMs) {
  const date = new Date(timeMs);
  const day = `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  return `${day} ${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

/** The browser's distance from UTC at that time: `UTC+02:00`. */
export function formatZone(timeMs) {
  const minutes = -new Date(timeMs).getTimezoneOffset();
  if (minutes === 0) return "UTC";
  const size = Math.abs(minutes);
  return `UTC${minutes < 0 ? "−" : "+"}${two(Math.floor(size / 60))}:${two(size % 60)}`;
}
