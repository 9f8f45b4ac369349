/** The plant at a glance: every unit, every bearing, worst state in words on top. */

import { element, setText } from "../dom.js";
import { mark } from "../parts/mark.js";
import { lookOf, qualityOf } from "../words.js";
import { unitCard } from "./unit_card.js";

/** Returns `{ draw(view), close() }`. */
export function overviewPage(main) {
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

const LOOK_WORDS = { bad: "bad", uncertain: "uncertain", absent: "without full result", good: "good" };

function tallyView(node) {
  const words = element("span");
  const store = mark();
  const captures = mark();
  const marks = Object.fromEntries(Object.keys(LOOK_WORDS).map((look) => [look, mark()]));
  node.append(words, ...Object.values(marks).map((one) => one.node), store.node, captures.node);
  return {
    draw(view) {
      const qualities = view.units.flatMap((unit) => unit.bearings.map(qualityOf));
      const looks = qualities.map(({ level, reason }) => lookOf(level, reason));
      const n = (look) => looks.filter((one) => one === look).length;
      store.node.hidden = view.storeError === null;
      store.draw("bad", `Results are not being stored: ${view.storeError}`);
      captures.node.hidden = view.captureError === null;
      captures.draw("uncertain", `Samples around alarms are not kept: ${view.captureError}`);
      setText(words, tallyWords(view, looks.length));
      for (const [look, one] of Object.entries(marks)) {
        one.node.hidden = n(look) === 0;
        one.draw(look, `${n(look)} ${LOOK_WORDS[look]}`);
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
