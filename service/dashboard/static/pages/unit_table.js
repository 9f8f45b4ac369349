/** The bearings of a unit side by side: a column for each bearing, a row for each question. */

import { amplitudeUnit } from "../amplitudes.js";
import { element, setText } from "../dom.js";
import { nowSentence } from "../film_words.js";
import { formatAge } from "../format.js";
import { centrePicture } from "../parts/centre_picture.js";
import { filmBrief } from "../parts/film_brief.js";
import { listingName, tableOf } from "../parts/listing.js";
import { drawQuality, mark } from "../parts/mark.js";
import { pairView, readingView } from "../parts/reading.js";
import { linkTo, wayLinks } from "../parts/ways.js";
import { bearingAddress } from "../route.js";
import { qualityOf, reasonSentence } from "../words.js";

const NO_SPREAD = () => null;
const pair = (names, labels, unit) => () => readingCell(pairView(names, labels, unit, NO_SPREAD));

/** Each row: its head, its unit, and a view that draws `(latest, film)`. */
const rows = () => [
  ["Verdict", "on the film against its baseline", filmCell],
  ["Film stiffness", "GN/m ± 95 %", () => readingCell(pairView(["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"], ["xx", "yy"], ""))],
  ["Shaft vibration, 1×", amplitudeUnit(), pair(["order1_shaft_x_um_pk", "order1_shaft_y_um_pk"], ["x", "y"], "")],
  ["Shaft vibration, broad-band", "µm pk-pk", pair(["overall_shaft_x_um_pp", "overall_shaft_y_um_pp"], ["x", "y"], "")],
  ["Bearing velocity, broad-band", "mm/s rms", pair(["overall_bearing_x_mm_s_rms", "overall_bearing_y_mm_s_rms"], ["x", "y"], "")],
  ["Shaft centre", "in the clearance circle", centreCell],
  ["Oil temperature", "", () => readingCell(readingView("oil_temperature_c", "", undefined, null))],
  ["Quality", "and data age", qualityCell],
  ["Open", "", null],
];

/** Returns `{ node, draw(unit) }`. */
export function unitTable(unit) {
  const bearings = unit.bearings.map(({ bearing }) => bearing);
  const drawn = rows().map((row) => tableRow(unit.id, bearings, row));
  const heads = unit.bearings.map(({ bearing, name }) => [linkTo(bearingAddress(unit.id, bearing), bearing), " ", element("small", { dir: "auto" }, name ?? "")]);
  const corner = [element("span", { class: "hidden" }, "Quantity")];
  const table = tableOf(`Bearings of ${unit.name} side by side`, [corner, ...heads], ...drawn.map((row) => row.node));
  return {
    node: element("section", { class: "panel side-by-side" }, table),
    draw(now) {
      bearings.forEach((_, n) => drawn.forEach((row) => row.cells[n].draw(now.bearings[n], now.films[n])));
    },
  };
}

function tableRow(unit, bearings, [head, words, view]) {
  const cells = bearings.map((bearing) => (view ? view() : { node: wayLinks(unit, bearing), draw() {} }));
  const boxes = cells.map((cell, n) => element("td", { role: "cell", "data-head": bearings[n], "data-bearing": bearings[n] }, cell.node));
  const title = listingName(head, element("small", {}, words));
  return { cells, node: element("tr", { role: "row" }, title, ...boxes) };
}

/** A reading's view as a cell: what the quality at the foot says is not shouted in every row. */
function readingCell(view) {
  return { node: view.node, draw: (latest) => view.draw(latest, qualityOf(latest).reason) };
}

/** The verdict, and in x and y what is measured and expected. */
function filmCell() {
  const verdict = filmBrief();
  const lines = ["x", "y"].map(() => element("span", { class: "from" }));
  return {
    node: element("div", {}, verdict.node, ...lines),
    draw(latest, film) {
      verdict.draw(film, null);
      lines.forEach((line, n) => setText(line, withDirection("xy"[n], film["xy"[n]])));
    },
  };
}

function centreCell() {
  const picture = centrePicture();
  const numbers = pairView(["eccentricity_ratio", "attitude_angle_deg"], ["ratio", "angle"], undefined, NO_SPREAD);
  return {
    node: element("div", { class: "centre-cell" }, picture.node, numbers.node),
    draw(latest) {
      picture.draw(latest);
      numbers.draw(latest, qualityOf(latest).reason);
    },
  };
}

function qualityCell() {
  const quality = mark();
  const why = element("span", { class: "from" });
  const age = element("span", { class: "data-age" });
  return {
    node: element("div", { class: "quality" }, quality.node, why, age),
    draw(latest) {
      const whole = qualityOf(latest);
      drawQuality(quality, whole);
      setText(why, whole.level === "good" ? "" : reasonSentence(whole.reason));
      setText(age, latest.age_s === null ? "no data yet" : `${formatAge(latest.age_s)} old`);
    },
  };
}

function withDirection(direction, film) {
  const now = film ? nowSentence(film) : "";
  return now && `${direction}: ${now}`;
}
