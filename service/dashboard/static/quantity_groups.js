/** What kinds of quantities there are, in words: each kind and unit has a chart of its own. */

import { kindOf } from "./format.js";

const GROUPS = [
  ["Film stiffness", /_n_per_m$|_of_kb$/],
  ["Film damping", /_n_s_per_m$|_of_kb_s$/],
  ["Vibration at 1×", /^order1_\w+_um_pk$/],
  ["Phase at 1×", /_phase_deg$/],
  ["Vibration of the vortex", /^vortex_\w+_um_pk$/],
  ["Broad-band vibration", /^overall_/],
  ["Shaft position", /^shaft_centre_|^eccentricity_|^attitude_/],
  ["Probe gaps", /gap_/],
  ["Operation", /^speed_rpm$|^power_mw$|^oil_temperature_c$|^head_|^gate_opening_|^excitation_/],
  ["Temperatures", /_temperature_/],
  ["Frequencies and shape of orbits", /_frequency_hz$|_roundness$/],
  ["How sure the estimates are", /./],
];

/** The kind of a quantity, in words. */
export const groupOf = (name) => GROUPS.find(([, pattern]) => pattern.test(name))[0];

/** A catalogue of quantities parted by kind: `[words, [[name, label], …]]`, in an order for people. */
export function grouped(catalogue) {
  const found = GROUPS.map(([words]) => [
    words,
    catalogue.filter(({ name }) => groupOf(name) === words).map(({ name, label }) => [name, label]),
  ]);
  return found.filter(([, options]) => options.length > 0);
}

/**
 * Names parted into those that share an axis: `{ chart, title, unit, names, words }`.
 *
 * `title` is their common part, `words` the part that differs, by name; `labels` has both.
 */
export function byAxis(names, labels) {
  const axes = new Map();
  for (const name of names) {
    const { unit } = kindOf(name);
    const chart = `${groupOf(name)} ${unit}`.toLowerCase();
    if (!axes.has(chart)) axes.set(chart, { chart, unit, names: [] });
    axes.get(chart).names.push(name);
  }
  return [...axes.values()].map((one) => ({ ...one, ...told(one.names, labels) }));
}

function told(names, labels) {
  if (names.length === 1) return { title: labels.get(names[0]), words: new Map([[names[0], ""]]) };
  const parts = new Map(names.map((name) => [name, labels.get(name).split(", ")]));
  const isCommon = (part) => [...parts.values()].every((one) => one.includes(part));
  const common = parts.get(names[0]).filter(isCommon);
  const words = names.map((name) => [name, parts.get(name).filter((part) => !isCommon(part)).join(", ")]);
  const isEnough = common.includes(parts.get(names[0])[0]);
  return { title: isEnough ? common.join(", ") : groupOf(names[0]), words: new Map(words) };
}
