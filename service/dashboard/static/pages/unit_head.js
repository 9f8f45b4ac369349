/** Where we are, how the unit runs, and whether its samples arrive. */

import { element, setText } from "../dom.js";
import { runningWords } from "../parts/running.js";
import { sourceView } from "../parts/source.js";
import { linkTo } from "../parts/ways.js";
import { SOURCES_ADDRESS, unitAddress } from "../route.js";
import { speedOrigin } from "../words.js";

/** Returns `{ node, draw(unit, view) }`. */
export function unitHead(unitId) {
  const title = element("h1", {}, unitId);
  const nav = element("nav", { class: "siblings", "aria-label": "Units of this plant" });
  const state = element("span", { class: "operating-state" });
  const origin = element("span", { class: "from" });
  const source = sourceView();
  const more = element("a", { class: "more", href: SOURCES_ADDRESS }, "Source health");
  source.node.append(more);
  let drawn = "";
  return {
    node: element("header", { class: "bearing-head" }, nav, title, element("div", { class: "state" }, state, origin), source.node),
    draw(unit, view) {
      const wanted = JSON.stringify(view.units.map((one) => [one.id, one.name]));
      const links = view.units.map(({ id, name }) => linkTo(unitAddress(id), name, id === unitId));
      if (wanted !== drawn) nav.replaceChildren(linkTo("#/", "Overview"), ...links);
      drawn = wanted;
      setText(title, unit.name);
      setText(state, runningWords(unit) || "Operating state not known");
      setText(origin, speedOrigin(unit.bearings[0]) && `Speed ${speedOrigin(unit.bearings[0])}`);
      source.draw(unit.source);
    },
  };
}
