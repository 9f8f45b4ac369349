/** Everything there is about one bearing, with the addresses of it. */

import { element } from "../dom.js";
import { bearingAddress, filmAddress, orbitAddress, waterfallAddress } from "../route.js";

/** Pairs of words and address. */
export function waysOf(unit, bearing) {
  return [
    ["Bearing", bearingAddress(unit, bearing)],
    ["Film", filmAddress(unit, bearing)],
    ["Spectra over time", waterfallAddress(unit, bearing)],
    ["Orbit player", orbitAddress(unit, bearing)],
    ["Trends", `#/trends?${new URLSearchParams([["b", `${unit}/${bearing}`]])}`],
  ];
}

/** The same as links, the one to where we are marked. */
export function wayLinks(unit, bearing, here = null) {
  const links = waysOf(unit, bearing).map(([words, href]) => element("li", {}, linkTo(href, words, href === here)));
  return element("ul", { class: "ways" }, ...links);
}

/** A link that says whether it leads to where we are. */
export function linkTo(href, words, isHere = false) {
  return element("a", isHere ? { href, "aria-current": "page" } : { href }, words);
}
