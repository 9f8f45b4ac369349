/** One generating unit on the overview: its state, and a row for each bearing. */

import { amplitudeUnit } from "../amplitudes.js";
import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { filmBrief } from "../parts/film_brief.js";
import { drawQuality, mark } from "../parts/mark.js";
import { pairView, readingView } from "../parts/reading.js";
import { runningView } from "../parts/running.js";
import { sourceView } from "../parts/source.js";
import { stiffnessBrief } from "../parts/stiffness_brief.js";
import { bearingAddress, unitAddress } from "../route.js";
import { qualityOf } from "../words.js";

const NO_SPREAD = () => null;
const PAIR = (head, unit, names, labels) => ({ head, unit, view: () => pairView(names, labels, "", NO_SPREAD) });
const SINGLE = (head, unit, name) => ({ head, unit, view: () => readingView(name, "", "", null) });

const columns = () => [
  { head: "Stiffness ± 95 %", unit: "GN/m, preferred estimator", view: stiffnessBrief },
  PAIR("Shaft 1×", amplitudeUnit(), ["order1_shaft_x_um_pk", "order1_shaft_y_um_pk"], ["x", "y"]),
  PAIR("Bearing 1×", amplitudeUnit(), ["order1_bearing_x_um_pk", "order1_bearing_y_um_pk"], ["x", "y"]),
  PAIR("k_eff 1×", "GN/m, eq. (5)", ["order1_k_eff_xx_n_per_m", "order1_k_eff_yy_n_per_m"], ["xx", "yy"]),
  PAIR("k_eff vortex", "GN/m, eq. (5)", ["vortex_k_eff_xx_n_per_m", "vortex_k_eff_yy_n_per_m"], ["xx", "yy"]),
  SINGLE("Eccentricity", "ratio", "eccentricity_ratio"),
  SINGLE("Oil", "°C", "oil_temperature_c"),
];

const [FILM, FILM_UNIT] = ["Film", "against its baseline"];

/** Returns `{ node, draw(unit) }`; `alarm` is the unit's mark of open alarms. */
export function unitCard(unit, alarm) {
  const running = runningView();
  const source = sourceView();
  const shown = columns();
  const rows = unit.bearings.map((latest) => bearingRow(unit.id, latest.bearing, shown));
  const head = element("div", { class: "unit-head" }, element("h2", {}, element("a", { href: unitAddress(unit.id) }, unit.name)), running.node, alarm.node, source.node);
  return {
    node: element("section", { class: "unit-card", "data-unit": unit.id }, head, table(unit, shown, rows)),
    draw(now) {
      running.draw(now);
      source.draw(now.source);
      alarm.draw();
      rows.forEach((row, index) => row.draw(now.bearings[index], now.films[index]));
    },
  };
}

function table(unit, shown, rows) {
  const heads = shown.map(({ head, unit: unitOf }) =>
    element("th", { scope: "col", role: "columnheader" }, head, element("small", {}, unitOf)),
  );
  const first = element("th", { scope: "col", role: "columnheader" }, "Bearing");
  const last = element("th", { scope: "col", role: "columnheader" }, "Quality", element("small", {}, "and data age"));
  const film = element("th", { scope: "col", role: "columnheader" }, FILM, element("small", {}, FILM_UNIT));
  const headRow = element("tr", { role: "row" }, first, ...heads, film, last);
  return element(
    "table",
    { role: "table", "aria-label": `Bearings of ${unit.name}` },
    element("thead", { role: "rowgroup" }, headRow),
    element("tbody", { role: "rowgroup" }, ...rows.map((row) => row.node)),
  );
}

function bearingRow(unit, bearing, shown) {
  const cells = shown.map((column) => column.view());
  const quality = mark();
  const film = filmBrief();
  const age = element("span", { class: "data-age" });
  const link = element("a", { href: bearingAddress(unit, bearing) }, bearing);
  const boxes = cells.map((cell, index) =>
    element("td", { role: "cell", "data-head": `${shown[index].head}, ${shown[index].unit}` }, cell.node),
  );
  const node = element(
    "tr",
    { role: "row", "data-bearing": bearing },
    element("th", { scope: "row", role: "rowheader" }, link),
    ...boxes,
    element("td", { role: "cell", class: "film-cell", "data-head": `${FILM}, ${FILM_UNIT}` }, film.node),
    element("td", { role: "cell", class: "quality" }, quality.node, age),
  );
  return {
    node,
    draw(latest, itsFilm) {
      const whole = qualityOf(latest);
      film.draw(itsFilm);
      for (const cell of cells) cell.draw(latest, whole.reason);
      drawQuality(quality, whole);
      setText(age, latest.age_s === null ? "no data yet" : `${formatAge(latest.age_s)} old`);
    },
  };
}
