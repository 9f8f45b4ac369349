/** The head of a page about one bearing: the way from the plant down to it, its neighbours, its pages. */

import { element, setText } from "../dom.js";
import { linkTo, wayLinks } from "../parts/ways.js";
import { unitAddress } from "../route.js";

/** `addressOf(unit, bearing)` is that of the page; `more` stands below the title. Returns `{ node, draw(view) }`. */
export function bearingHead(unitId, bearingId, topic, addressOf, ...more) {
  const title = element("h1", { dir: "auto" }, `${unitId} ${bearingId}${topic}`);
  const nav = element("nav", { class: "siblings", "aria-label": "Plant, unit and its bearings" }, linkTo("#/", "Overview"));
  const ways = wayLinks(unitId, bearingId, addressOf(unitId, bearingId));
  let known = "";
  return {
    node: element("header", { class: "bearing-head" }, nav, title, ...more, element("nav", { "aria-label": `Pages about ${bearingId}` }, ways)),
    draw({ units }) {
      const unit = units.find(({ id }) => id === unitId);
      if (!unit) return;
      const name = unit.bearings.find(({ bearing }) => bearing === bearingId)?.name;
      setText(title, `${unit.name}, ${[bearingId, name].filter(Boolean).join(" ")}${topic}`);
      const names = unit.bearings.map(({ bearing }) => bearing);
      if (known === names.join(" ")) return;
      known = names.join(" ");
      const bearings = names.map((name) => linkTo(addressOf(unitId, name), name, name === bearingId));
      nav.replaceChildren(linkTo("#/", "Overview"), linkTo(unitAddress(unitId), unit.name), ...bearings);
    },
  };
}
