/** What is said of a film now, in words: verdict, change with its uncertainty, cause, condition. */

import { element, setText } from "../dom.js";
import { changeSentence, causeSentence, conditionWords, dampingSentences, limitWords, nowSentence, pendingSentence, verdictMark, whyUnjudged } from "../film_words.js";
import { formatTime } from "../format.js";
import { mark } from "../parts/mark.js";
import { estimatorWords } from "../words.js";

/** Returns `{ node, draw(film), fail(sentence) }`; `link` is put into the panel's head. */
export function verdictPanel(link = "") {
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const rows = ["x", "y"].map(directionRow);
  const facts = element("p", { class: "film-facts" });
  const [cause, limits, condition, compared, due] = Array.from({ length: 5 }, () => element("span"));
  facts.append(cause, limits, condition, compared, due);
  const verdicts = element("div", { class: "verdicts", hidden: "" }, ...rows.map((row) => row.node));
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Film against its baseline"), link);
  facts.hidden = true;
  return {
    node: element("section", { class: "panel film-verdict" }, head, sentence, verdicts, facts),
    draw(film) {
      verdicts.hidden = facts.hidden = !film.is_watched;
      sentence.hidden = film.is_watched;
      setText(sentence, film.is_watched ? "" : `This film is not watched: ${film.why_not}.`);
      if (!film.is_watched) return;
      const causes = [film.x, film.y].map((one) => causeSentence(one.cause));
      const isShared = causes[0] === causes[1]; // then it is said once
      setText(cause, isShared ? causes[0] : "");
      rows.forEach((row, n) => row.draw(film["xy"[n]], film.limits, isShared ? "" : causes[n]));
      setText(limits, `${limitWords(film.limits)}.`);
      setText(condition, conditionWords(film.condition));
      setText(compared, comparedWords(film));
      setText(due, dueWords(film));
    },
    fail(words) {
      verdicts.hidden = facts.hidden = true;
      sentence.hidden = false;
      setText(sentence, `Nothing is known of the film now. ${words}`);
    },
  };
}

function directionRow(direction) {
  const verdict = mark();
  const change = element("span", { class: "change" });
  const said = element("span", { class: "said" });
  return {
    node: element("div", { class: "verdict", "data-direction": direction }, element("span", { class: "axis" }, direction), verdict.node, element("span", {}, change, " ", said)),
    draw(found, limits, cause) {
      const now = { ...found, deviation_percent: found.deviation?.percent ?? null };
      const onlyDamped = found.level === null && found.damping.level !== null;
      verdict.draw(...(onlyDamped ? [found.damping.level, "c/k changed"] : verdictMark(now, limits)));
      setText(change, nowSentence(now));
      setText(said, [whyUnjudged(found), changeSentence(found), pendingSentence(found, limits), cause, dampingSentences(found.damping)].filter(Boolean).join(" "));
    },
  };
}

function comparedWords({ baseline_version: version, estimator }) {
  const by = `Stiffness: ${estimatorWords(estimator)}`;
  return version === null ? `${by}; no baseline in force.` : `${by}, compared with baseline version ${version}.`;
}

function dueWords({ time, next_reading: next }) {
  const newest = time === null ? "No reading since the service started." : `Newest reading ${formatTime(Date.parse(time))}.`;
  return next === null ? newest : `${newest} Next one due ${formatTime(Date.parse(next))}.`;
}
