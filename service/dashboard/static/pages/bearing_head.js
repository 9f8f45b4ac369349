/** The head of a page about one bearing: where we are, and the ways to the other pages about it. */

import { element, setText } from "../dom.js";
import { bearingAddress, filmAddress, orbitAddress, unitAddress, waterfallAddress } from "../route.js";

const PAGES = [
  ["", (bearing) => `Bearing ${bearing}`, bearingAddress],
  ["waterfall", () => "Spectra over time", waterfallAddress],
  ["orbits", () => "Orbit player", orbitAddress],
  ["film", () => "Film", filmAddress],
];

const OF_BEARING = { waterfall: waterfallAddress, orbits: orbitAddress, film: filmAddress };

/** `here` is one of `waterfall`, `orbits` and `film`; returns `{ node, draw(view) }`. */
export function bearingHead(unitId, bearingId, topic, here) {
  const title = element("h1", {}, `${unitId} ${bearingId}: ${topic}`);
  const parents = [link("#/", "Overview"), link(unitAddress(unitId), unitId)];
  const pages = PAGES.map(([name, words, address]) => link(address(unitId, bearingId), words(bearingId), name === here));
  const about = element("nav", { class: "siblings", "aria-label": `Pages about ${bearingId}` }, ...parents, ...pages);
  const others = element("nav", { class: "siblings", "aria-label": "Bearings of this unit" });
  let known = "";
  return {
    node: element("header", { class: "bearing-head" }, about, title, others),
    draw(view) {
      const unit = view.units.find((one) => one.id === unitId);
      if (!unit) return;
      setText(parents[1], unit.name);
      setText(title, `${unit.name}, ${bearingId}: ${topic}`);
      const names = unit.bearings.map(({ bearing }) => bearing);
      if (known === names.join(" ")) return;
      known = names.join(" ");
      others.replaceChildren(...names.map((name) => link(OF_BEARING[here](unitId, name), name, name === bearingId)));
    },
  };
}

function link(href, words, isHere) {
  const made = element("a", { href }, words);
  if (isHere) made.setAttribute("aria-current", "page");
  return made;
}
