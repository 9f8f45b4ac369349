/** Everything there is about one bearing, with the addresses of it. */

import { element } from "../dom.js";
import { bearingAddress, filmAddress, orbitAddress, waterfallAddress } from "../route.js";

/** Pairs of words and address. */
export function waysOf(unit, bearing) {
  return [
    ["Numbers and charts", bearingAddress(unit, bearing)],
    ["Film and baseline", filmAddress(unit, bearing)],
    ["Spectra over time", waterfallAddress(unit, bearing)],
    ["Orbit player", orbitAddress(unit, bearing)],
    ["Trends", `#/trends?${new URLSearchParams([["b", `${unit}/${bearing}`]])}`],
  ];
}

/** The same as links, without the one to where we are. */
export function wayLinks(unit, bearing, here = null) {
  const ways = waysOf(unit, bearing).filter(([, href]) => href !== here);
  const links = ways.map(([words, href]) => element("li", {}, element("a", { href }, words)));
  return element("ul", { class: "ways" }, ...links);
}
