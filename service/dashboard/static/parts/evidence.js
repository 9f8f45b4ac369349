/** Links to what was known when an alarm was raised: a page to print, and everything to take away. */

import { element, setAttribute } from "../dom.js";

/** Returns `{ node, draw(alarm, occurrence) }`; without an occurrence there is nothing to see. */
export function evidenceLinks() {
  const report = link("report", "One page to read or print");
  const bundle = link("evidence", "Everything that was known, as a ZIP file");
  const node = element("span", { class: "evidence" }, report, " ", bundle);
  return {
    node,
    draw(alarm, occurrence) {
      node.hidden = !occurrence;
      const path = `/api/v1/alarms/${encodeURIComponent(alarm)}/evidence/${occurrence}`;
      setAttribute(report, "href", `${path}/report`);
      setAttribute(bundle, "href", `${path}/bundle.zip`);
    },
  };
}

function link(words, title) {
  return element("a", { href: "#/alarms", target: "_blank", rel: "noopener", title }, words);
}
