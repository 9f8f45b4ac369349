/** A film in a word or two for the overview, once if it is the same in x and y. */

import { element, setAttribute } from "../dom.js";
import { signedPercent, verdictMark } from "../film_words.js";
import { mark } from "./mark.js";

/** Returns `{ node, draw(film) }`. */
export function filmBrief() {
  const marks = [mark(), mark()];
  const node = element("div", { class: "film-brief" }, ...marks.map((one) => one.node));
  return {
    node,
    draw(film) {
      setAttribute(node, "title", film.why_not);
      const said = film.why_not ? [["absent", "Not watched"]] : wordsOf(film);
      marks.forEach((one, index) => {
        one.node.hidden = index >= said.length;
        if (index < said.length) one.draw(...said[index]);
      });
    },
  };
}

function wordsOf({ x, y }) {
  const found = [x, y].map(oneWord);
  if (found[0].join() === found[1].join()) return [found[0]];
  return found.map(([look, words], index) => [look, `${"xy"[index]} ${words}`]);
}

function oneWord(film) {
  const [look, words] = verdictMark(film);
  const percent = film.level !== null && film.change_percent !== null ? ` ${signedPercent(film.change_percent, 0)}` : "";
  return [look, words + percent];
}
