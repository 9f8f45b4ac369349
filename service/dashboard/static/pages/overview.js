/** The plant at a glance: every unit, every bearing, worst state in words on top. */

import { element, setText } from "../dom.js";
import { mark } from "../parts/mark.js";
import { unitCard } from "./unit_card.js";

/** Returns `{ draw(view), close() }`. */
export function overviewPage(main) {
  document.title = "padwatch: overview";
  const summary = element("p", { class: "summary" });
  const cards = element("div", { class: "units" });
  main.append(element("h1", { class: "hidden" }, "Plant overview"), summary, cards);
  const tally = tallyView(summary);
  let shape = null;
  let drawn = [];
  return {
    draw(view) {
      const wanted = JSON.stringify(view.units.map((unit) => [unit.id, unit.name, unit.bearings.map((b) => b.bearing)]));
      if (wanted !== shape) {
        shape = wanted;
        drawn = view.units.map(unitCard);
        cards.replaceChildren(...drawn.map((card) => card.node));
      }
      tally.draw(view);
      drawn.forEach((card, index) => card.draw(view.units[index]));
    },
    close() {},
  };
}

const LEVEL_WORDS = { good: "good", uncertain: "uncertain", bad: "bad, no number shown" };

function tallyView(node) {
  const words = element("span");
  const marks = Object.fromEntries(["bad", "uncertain", "good"].map((level) => [level, mark()]));
  node.append(words, ...Object.values(marks).map((one) => one.node));
  return {
    draw(view) {
      const levels = view.units.flatMap((unit) => unit.bearings.map((latest) => latest.quality.level));
      const n = (level) => levels.filter((one) => one === level).length;
      setText(words, tallyWords(view, levels.length));
      for (const [level, one] of Object.entries(marks)) {
        one.node.hidden = n(level) === 0;
        one.draw(level, `${n(level)} ${LEVEL_WORDS[level]}`);
      }
    },
  };
}

function tallyWords(view, nBearings) {
  if (view.silenceS === null) return "No numbers yet: the service has not answered.";
  if (view.units.length === 0) return "The plant file names no units.";
  const connected = view.units.filter((unit) => unit.source.state === "connected").length;
  return `${connected} of ${view.units.length} units connected. ${nBearings} bearings:`;
}
