/** A reading on the page: its number while it is current, else a dash and why. */

import { element, setAttribute, setText } from "../dom.js";
import { formatQuantity, kindOf } from "../format.js";
import { lookOf, reasonWords } from "../words.js";
import { markShape } from "./mark.js";
import { spreadView } from "./spread.js";

const DASH = "—";
const ABSENT = { value: null, level: "bad", reason: "not_measured", uncertainty: null };

/** Reading of a bearing with its name: of the ratio where the bracket's stiffness is unknown; not measured where unreported. */
export function readingOf(latest, name) {
  const ratio = name.replace(/_n_per_m$/, "_of_kb").replace(/_n_s_per_m$/, "_of_kb_s");
  const reported = ratio in latest.readings ? ratio : name;
  return { ...(latest.readings[reported] ?? ABSENT), name: reported };
}

/**
 * One number with an optional label before and a unit after it.
 *
 * Returns `{ node, draw(latest, saidReason) }`. What `saidReason` beside it says already is not said
 * again loudly: a doubted number stands alone, a missing one gives its reason without a shape.
 * `spread` shows the uncertainty after the number; null for none.
 */
export function readingView(name, label, unit = kindOf(name).unit, spread = spreadView(name)) {
  const number = element("span", { class: "number" });
  const why = element("span", { class: "why" });
  const suffix = element("span", { class: "suffix" }, unit);
  const node = element("span", { class: "reading", "data-reading": name });
  if (label) node.append(element("span", { class: "axis" }, label));
  node.append(number, ...(spread ? [spread.node] : []), suffix, why);
  return {
    node,
    draw(latest, saidReason = null) {
      const reading = readingOf(latest, name);
      const absent = reading.value === null;
      setText(number, absent ? DASH : formatQuantity(reading.name, reading.value));
      spread?.draw(reading);
      setText(suffix, reading.name === name ? unit : kindOf(reading.name).unit);
      suffix.hidden = absent || suffix.textContent === "";
      setAttribute(node, "data-level", reading.level);
      drawReason(why, reading, saidReason);
    },
  };
}

function drawReason(why, reading, saidReason) {
  const said = reading.reason === saidReason;
  const silent = reading.level === "good" || (said && reading.value !== null);
  const words = silent ? "" : reasonWords(reading.reason);
  const look = said ? "" : lookOf(reading.level, reading.reason);
  if (why.textContent === words && why.dataset.look === look) return;
  why.dataset.look = look;
  why.replaceChildren(...(silent ? [] : said ? [words] : [markShape(look), words]));
}

/** Readings in one cell; when all are missing for one reason, one dash stands for all. */
export function pairView(names, labels, unit, spreadOf = spreadView) {
  const views = names.map((name, index) => readingView(name, labels[index], unit, spreadOf(name)));
  const node = element("span", { class: "pair" }, ...views.map((view) => view.node));
  return {
    node,
    draw(latest, saidReason = null) {
      for (const view of views) view.draw(latest, saidReason);
      node.classList.toggle("merged", missingAlike(latest, names));
    },
  };
}

/** Whether several readings are missing for one and the same reason. */
export function missingAlike(latest, names) {
  const [first, ...others] = names.map((name) => readingOf(latest, name));
  const isAlike = ({ value, reason }) => value === null && reason === first.reason;
  return others.length > 0 && first.value === null && others.every(isAlike);
}
