/** One generating unit of many: small enough that twenty of them stand on one screen. */

import { element, setAttribute, setText } from "../dom.js";
import { formatQuantity } from "../format.js";
import { mark } from "../parts/mark.js";
import { readingOf } from "../parts/reading.js";
import { bearingAddress } from "../route.js";
import { bearingVerdict } from "../verdict_words.js";
import { NOT_CURRENT, briefWords, lookOf, qualityOf, sourceState } from "../words.js";
import { asCompared, changeOf, unitTitle } from "./unit_card.js";

const DASH = "—";
const STIFFNESS = ["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"];

/** What the columns of all tiles are, said once above them. */
export const TILE_LEGEND =
  "Each bearing: film stiffness in x and y, GN/m; larger change against the baseline; verdict, or what is wrong with its data.";

/** Returns `{ node, draw(unit, alarmsOf) }`; `alarm` is the unit's mark of open alarms. */
export function unitTile(unit, alarm) {
  const rows = unit.bearings.map((one) => bearingLine(unit.id, one));
  const head = unitTitle(unit, alarm, "tile-head");
  const body = element("tbody", {}, ...rows.map((row) => row.node));
  return {
    node: element("section", { class: "unit-tile", "data-unit": unit.id }, head.node, element("table", { "aria-label": `Bearings of ${unit.name}` }, body)),
    draw(now, alarmsOf) {
      head.draw(now);
      const isSaid = sourceState(now.source.state).level !== "good";
      rows.forEach((row, n) => row.draw(now.bearings[n], now.films[n], alarmsOf(now.bearings[n].bearing), isSaid));
    },
  };
}

function bearingLine(unit, { bearing, name }) {
  const numbers = [...STIFFNESS, "change"].map((one) => element("td", { class: "number", "data-reading": one }));
  const state = mark();
  const link = element("a", { href: bearingAddress(unit, bearing) }, bearing);
  setAttribute(link, "title", name);
  return {
    node: element("tr", { "data-bearing": bearing }, element("th", { scope: "row" }, link), ...numbers, element("td", { class: "quality" }, state.node)),
    draw(latest, film, alarms, isSaid) {
      const shown = asCompared(latest, film);
      const texts = [...STIFFNESS.map((one) => digits(readingOf(shown, one))), changeOf(worseOf(film))];
      texts.forEach((text, index) => setText(numbers[index], text));
      state.draw(...stateOf(latest, film, alarms, isSaid));
    },
  };
}

const digits = ({ name, value }) => (value === null ? DASH : formatQuantity(name, value));

function worseOf({ x, y }) {
  const size = (one) => Math.abs(one?.deviation_percent ?? 0);
  return size(y) > size(x) ? y : x;
}

/**
 * What is worst of a bearing in few words: an alarm, or what is wrong with its data, or the verdict on its film.
 *
 * `isSaid`: the head of the tile says loudly already why nothing current arrives.
 */
function stateOf(latest, film, alarms, isSaid) {
  const [look, , words] = bearingVerdict(film, alarms);
  if (look === "danger" || look === "alert") return [look, words];
  const { level, reason } = qualityOf(latest);
  if (isSaid && NOT_CURRENT.has(reason)) return ["absent", "no data"];
  return level === "good" ? [look, words] : [lookOf(level, reason), briefWords(reason)];
}
