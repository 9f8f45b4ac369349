/** The plant at a glance: every unit, every bearing, worst state in words on top. */

import { element, setText } from "../dom.js";
import { alarmsToAcknowledge } from "../parts/alarm_brief.js";
import { mark } from "../parts/mark.js";
import { unitAlarmMarks } from "../parts/unit_alarm_mark.js";
import { lookOf, qualityOf } from "../words.js";
import { unitCard } from "./unit_card.js";
import { tileLegend, unitTile } from "./unit_tile.js";

/** With more units than these, each is a tile: numbers that matter, all on one screen. */
export const N_CARDS = 4;

/** Returns `{ draw(view), close() }`. */
export function overviewPage(main) {
  const summary = element("p", { class: "summary" });
  const legend = element("p", { class: "help" });
  const units = element("div");
  const unseen = alarmsToAcknowledge();
  main.append(element("h1", { class: "hidden" }, "Plant overview"), summary, unseen.node, legend, units);
  const tally = tallyView(summary);
  const alarms = unitAlarmMarks();
  let shape = null;
  let drawn = [];

  function build(view) {
    const isLarge = view.units.length > N_CARDS;
    const viewOf = isLarge ? unitTile : unitCard;
    drawn = view.units.map((unit) => viewOf(unit, alarms.markOf(unit.id)));
    units.className = isLarge ? "unit-tiles" : "units";
    units.replaceChildren(...drawn.map((one) => one.node));
    legend.hidden = !isLarge;
    setText(legend, tileLegend());
  }

  return {
    draw(view) {
      const wanted = JSON.stringify(view.units.map((unit) => [unit.id, unit.name, unit.bearings.map((b) => b.bearing)]));
      if (wanted !== shape) build(view);
      shape = wanted;
      tally.draw(view);
      drawn.forEach((one, index) => one.draw(view.units[index]));
    },
    close: () => [alarms, unseen].forEach((one) => one.close()),
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
