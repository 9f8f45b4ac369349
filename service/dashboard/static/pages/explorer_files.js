/** What is shown, to take away: a file for each bearing. */

import { element } from "../dom.js";

const FORMATS = [["csv", "CSV"], ["parquet", "Parquet"]];

/** Returns `{ node, show(asked) }`; `asked` is a list of `{ bearing, query }`. */
export function explorerFiles() {
  const node = element("p", { class: "explorer-files", hidden: "" });
  return {
    node,
    show(asked) {
      node.hidden = asked.length === 0;
      node.replaceChildren("Export:", ...asked.flatMap(linksOf));
    },
  };
}

function linksOf({ bearing: [unit, bearing], query }) {
  const path = ["units", unit, "bearings", bearing, "trends"].map(encodeURIComponent).join("/");
  const links = FORMATS.map(([format, words]) => {
    const search = new URLSearchParams([...query, ["format", format]]);
    return element("a", { href: `/api/v1/${path}?${search}`, download: "" }, `${unit} ${bearing} as ${words}`);
  });
  return links.flatMap((link) => [" ", link]);
}
