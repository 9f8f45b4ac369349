/** One generating unit on the overview: how it runs, and a row for each bearing with its verdict. */

import { element, setAttribute, setText } from "../dom.js";
import { signedPercent } from "../film_words.js";
import { formatAge } from "../format.js";
import { filmBrief } from "../parts/film_brief.js";
import { listingCell, listingName, tableOf } from "../parts/listing.js";
import { drawQuality, mark } from "../parts/mark.js";
import { pairView, readingOf, readingView } from "../parts/reading.js";
import { runningWords } from "../parts/running.js";
import { sparkline } from "../parts/sparkline.js";
import { bearingAddress, unitAddress } from "../route.js";
import { qualityOf, sourceState } from "../words.js";

const HEADS = [
  ["Bearing", ""],
  ["Film stiffness", "GN/m"],
  ["Change", "%"],
  ["Trend", ""],
  ["Eccentricity", ""],
  ["Oil", "°C"],
  ["Verdict", ""],
  ["Data", ""],
];
const STIFFNESS = ["stiffness_xx_n_per_m", "stiffness_yy_n_per_m"];
const NO_SPREAD = () => null;

/** The age of data that are not good is shown above this; a result is due every 12 s. */
const OLD_S = 20;

/**
 * Returns `{ node, draw(unit, alarmsOf, historyOf) }`.
 *
 * `alarm` is the unit's mark of open alarms. The heads of columns are shown for the first unit and read out for each.
 */
export function unitCard(unit, alarm, isFirst) {
  const rows = unit.bearings.map((one) => bearingRow(unit.id, one));
  const heads = HEADS.map(([words, of]) => (isFirst ? [words, " ", element("small", {}, of)] : element("span", { role: "img", "aria-label": `${words} ${of}` })));
  const table = tableOf(`Bearings of ${unit.name}`, heads, ...rows.map((row) => row.node));
  const head = unitTitle(unit, alarm, "unit-head");
  const node = element("section", { class: "unit-card", "data-unit": unit.id }, head.node, table);
  return {
    node,
    draw(now, alarmsOf, historyOf) {
      head.draw(now);
      setAttribute(node, "data-worst", alarm.node.dataset.look ?? null);
      rows.forEach((row, n) => row.draw(now.bearings[n], now.films[n], alarmsOf(now.bearings[n].bearing), historyOf(now.bearings[n].bearing)));
    },
  };
}

/** Name of a unit, how it runs, its open alarms, and its data source while something is wrong with it. */
export function unitTitle({ id, name }, alarm, style) {
  const running = element("span", { class: "running" });
  const link = mark();
  const title = element("h2", { dir: "auto" }, element("a", { href: unitAddress(id) }, name));
  return {
    node: element("div", { class: style }, title, running, alarm.node, link.node),
    draw(now) {
      const { level, words } = sourceState(now.source.state);
      setText(running, runningWords(now));
      link.node.hidden = level === "good";
      link.draw(level, now.source.reason ? `${words}: ${now.source.reason}` : words);
      alarm.draw();
    },
  };
}

function bearingRow(unit, { bearing, name }) {
  const stiffness = pairView(STIFFNESS, ["x", "y"], "", NO_SPREAD);
  const changes = ["x", "y"].map(() => element("span"));
  const trend = sparkline();
  const eccentricity = readingView("eccentricity_ratio", "", "", null);
  const oil = readingView("oil_temperature_c", "", "", null);
  const film = filmBrief();
  const quality = mark();
  const age = element("span", { class: "data-age" });
  const data = element("span", { class: "quality" }, quality.node, age);
  const change = element("span", { class: "pair change" }, ...changes);
  const nodes = [stiffness.node, change, trend.node, eccentricity.node, oil.node, film.node, data];
  const cells = nodes.map((node, n) => listingCell(HEADS[n + 1].join(" "), node));
  const link = element("a", { href: bearingAddress(unit, bearing) }, bearing);
  const title = listingName(link, " ", element("small", { dir: "auto" }, name ?? ""));
  return {
    node: element("tr", { role: "row", "data-bearing": bearing }, title, ...cells),
    draw(latest, itsFilm, alarms, history) {
      const whole = qualityOf(latest);
      stiffness.draw(asCompared(latest, itsFilm), whole.reason);
      changes.forEach((node, n) => setText(node, changeOf(itsFilm["xy"[n]]).replace(/ %$/, "")));
      trend.draw(history);
      for (const view of [eccentricity, oil]) view.draw(latest, whole.reason);
      film.draw(itsFilm, alarms);
      quality.node.hidden = whole.level === "good";
      drawQuality(quality, whole);
      setText(age, whole.level !== "good" && latest.age_s > OLD_S ? `${formatAge(latest.age_s)} old` : "");
    },
  };
}

/** Newest deviation from what the baseline expects, in percent; nothing while there is none. */
export const changeOf = (film) => (film?.deviation_percent == null ? "" : signedPercent(film.deviation_percent, 0));

/** A result with the stiffness that was compared with the baseline in place of the newest: one belongs to the change. */
export function asCompared(latest, film) {
  const readings = { ...latest.readings };
  STIFFNESS.forEach((name, n) => {
    const value = film["xy"[n]]?.stiffness_of_kb ?? film["xy"[n]]?.stiffness_n_per_m ?? null;
    const newest = readingOf(latest, name);
    if (value !== null && newest.value !== null) readings[newest.name] = { ...newest, value };
  });
  return { ...latest, readings };
}
