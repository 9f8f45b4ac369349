/** The verdict on a bearing on the overview, with what is expected and confirmed while an alarm is active. */

import { element, setAttribute, setText } from "../dom.js";
import { bearingVerdict, confirmedWords } from "../verdict_words.js";
import { mark } from "./mark.js";

/** Returns `{ node, draw(film, alarms) }`. */
export function filmBrief() {
  const verdict = mark();
  const detail = element("span", { class: "from" });
  const node = element("div", { class: "film-brief" }, verdict.node, detail);
  return {
    node,
    draw(film, alarms) {
      setAttribute(node, "title", film.why_not);
      const [look, words] = bearingVerdict(film, alarms);
      verdict.draw(look, words);
      setText(detail, confirmedWords(film));
    },
  };
}
