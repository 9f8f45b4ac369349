/** Where we are, how the unit runs, and whether its samples arrive. */

import { element, setAttribute, setText } from "../dom.js";
import { runningWords } from "../parts/running.js";
import { sourceView } from "../parts/source.js";
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
      if (wanted !== drawn) nav.replaceChildren(element("a", { href: "#/" }, "Overview"), ...view.units.map((one) => unitLink(one, unitId)));
      drawn = wanted;
      setText(title, unit.name);
      setText(state, runningWords(unit) || "Operating state not known");
      setText(origin, speedOrigin(unit.bearings[0]) && `Speed ${speedOrigin(unit.bearings[0])}`);
      source.draw(unit.source);
    },
  };
}

function unitLink({ id, name }, here) {
  const link = element("a", { href: unitAddress(id) }, name);
  setAttribute(link, "aria-current", id === here ? "page" : null);
  return link;
}
