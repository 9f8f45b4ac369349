/** One generating unit of many: small enough that twenty of them stand on one screen. */

import { element, setText } from "../dom.js";
import { formatQuantity, kindOf } from "../format.js";
import { verdictMark } from "../film_words.js";
import { mark } from "../parts/mark.js";
import { readingOf } from "../parts/reading.js";
import { bearingAddress, unitAddress } from "../route.js";
import { NOT_CURRENT, briefWords, lookOf, qualityOf, sourceState } from "../words.js";

const DASH = "—";
const SHAFT = ["order1_shaft_x_um_pk", "order1_shaft_y_um_pk"];
const STIFFNESS = ["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"];

/** What the columns of all tiles are, said once above them. */
export const tileLegend = () =>
  `Each bearing: film stiffness xx and yy in GN/m, larger shaft vibration at 1× in ${kindOf(SHAFT[0]).unit}, and its state.`;

/** Returns `{ node, draw(unit) }`; `alarm` is the unit's mark of open alarms. */
export function unitTile(unit, alarm) {
  const running = element("span", { class: "running" });
  const link = mark();
  const rows = unit.bearings.map(({ bearing }) => bearingLine(unit.id, bearing));
  const title = element("h2", {}, element("a", { href: unitAddress(unit.id) }, unit.name));
  const head = element("div", { class: "tile-head" }, title, running, link.node, alarm.node);
  const body = element("tbody", {}, ...rows.map((row) => row.node));
  return {
    node: element("section", { class: "unit-tile", "data-unit": unit.id }, head, element("table", { "aria-label": `Bearings of ${unit.name}` }, body)),
    draw(now) {
      setText(running, runningWords(now));
      const { level, words } = sourceState(now.source.state);
      link.node.hidden = level === "good";
      link.draw(level, words);
      alarm.draw();
      rows.forEach((row, index) => row.draw(now.bearings[index], now.films[index], level !== "good"));
    },
  };
}

function runningWords({ bearings }) {
  const parts = ["speed_rpm", "power_mw"].map((name) => {
    const known = bearings.map((bearing) => readingOf(bearing, name).value).find((value) => value !== null);
    return known === undefined ? "" : `${formatQuantity(name, known)} ${kindOf(name).unit}`;
  });
  return parts.filter(Boolean).join(", ");
}

function bearingLine(unit, bearing) {
  const numbers = [STIFFNESS[0], STIFFNESS[1], SHAFT[0]].map((name) => element("td", { class: "number", "data-reading": name }));
  const state = mark();
  const link = element("a", { href: bearingAddress(unit, bearing) }, bearing);
  return {
    node: element("tr", { "data-bearing": bearing }, element("th", { scope: "row" }, link), ...numbers, element("td", { class: "quality" }, state.node)),
    draw(latest, film, isSaid) {
      const texts = [...STIFFNESS.map((name) => digits(name, readingOf(latest, name).value)), digits(SHAFT[0], largest(latest))];
      texts.forEach((text, index) => setText(numbers[index], text));
      state.draw(...stateOf(latest, film, isSaid));
    },
  };
}

const digits = (name, value) => (value === null ? DASH : formatQuantity(name, value));

function largest(latest) {
  const values = SHAFT.map((name) => readingOf(latest, name).value).filter((value) => value !== null);
  return values.length ? Math.max(...values) : null;
}

/**
 * What is worst of a bearing in few words: its readings first, for a film is judged by them.
 *
 * `isSaid`: the head of the tile says loudly already why nothing current arrives.
 */
function stateOf(latest, film, isSaid) {
  const { level, reason } = qualityOf(latest);
  const look = lookOf(level, reason);
  if (isSaid && NOT_CURRENT.has(reason)) return ["absent", "no data"];
  if (look === "bad") return [look, briefWords(reason)];
  const verdicts = film.why_not === null ? [film.x, film.y].map(verdictMark) : [];
  const judged = verdicts.find(([one]) => one === "bad") ?? verdicts.find(([one]) => one === "uncertain");
  if (judged) return [judged[0], `film ${judged[1].toLowerCase()}`];
  return [look, look === "good" ? "good" : briefWords(reason)];
}
