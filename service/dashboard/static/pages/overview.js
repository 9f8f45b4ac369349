/** The plant at a glance: every unit, every bearing, verdicts on top. */

import { askReadings } from "../api.js";
import { element, setText } from "../dom.js";
import { alarmsToAcknowledge } from "../parts/alarm_brief.js";
import { mark } from "../parts/mark.js";
import { openAlarms } from "../parts/unit_alarm_mark.js";
import { poll } from "../poll.js";
import { serviceTimeMs } from "../server_time.js";
import { bearingVerdict } from "../verdict_words.js";
import { qualityOf } from "../words.js";
import { unitCard } from "./unit_card.js";
import { TILE_LEGEND, unitTile } from "./unit_tile.js";

/** With more units than these, each is a tile: numbers that matter, all on one screen. */
const N_CARDS = 4;

const [TREND_PERIOD_S, TREND_SPAN_S, TREND_POINTS] = [60, 8 * 3600, 96];

/** Returns `{ draw(view), close() }`. */
export function overviewPage(main) {
  const summary = element("p", { class: "summary" });
  const units = element("div");
  const unseen = alarmsToAcknowledge();
  main.append(element("h1", { class: "hidden" }, "Plant"), summary, element("p", { class: "help", hidden: "" }, TILE_LEGEND), units, unseen.node);
  const tally = tallyView(summary);
  const alarms = openAlarms();
  const histories = new Map();
  let shape = null;
  let drawn = [];
  let films = [];

  const trends = poll(async (signal) => {
    const give = (failure) => (signal.aborted ? Promise.reject(failure) : null); // the row has no trend then, and all else
    for (const [unit, bearing] of films) {
      const path = ["units", unit, "bearings", bearing];
      histories.set(`${unit}/${bearing}`, await askReadings(path, serviceTimeMs(), TREND_SPAN_S, TREND_POINTS, signal).catch(give));
    }
  }, () => TREND_PERIOD_S);

  function build(view) {
    const isLarge = view.units.length > N_CARDS;
    const viewOf = isLarge ? unitTile : unitCard;
    drawn = view.units.map((unit, n) => viewOf(unit, alarms.markOf(unit.id), n === 0));
    units.className = isLarge ? "unit-tiles" : "units";
    units.replaceChildren(...drawn.map((one) => one.node));
    summary.nextSibling.hidden = !isLarge;
    const watched = view.units.flatMap((unit) => unit.bearings.filter((_, n) => unit.films[n].why_not === null).map(({ bearing }) => [unit.id, bearing]));
    films = isLarge ? [] : watched;
    trends.again();
  }

  return {
    draw(view) {
      const wanted = JSON.stringify(view.units.map((unit) => [unit.id, unit.name, unit.bearings.map((b) => [b.bearing, b.name])]));
      if (wanted !== shape) build(view);
      shape = wanted;
      tally.draw(view, alarms);
      drawn.forEach((one, n) => {
        const { id } = view.units[n];
        one.draw(view.units[n], (bearing) => alarms.of(id, bearing), (bearing) => histories.get(`${id}/${bearing}`) ?? null);
      });
    },
    close() {
      [alarms, unseen].forEach((one) => one.close());
      trends.stop();
    },
  };
}

const VERDICTS = { danger: "danger", alert: "alert", normal: "normal", quiet: "not judged" };

function tallyView(node) {
  const words = element("span");
  const [store, captures, data] = [mark(), mark(), mark()];
  const marks = Object.fromEntries(Object.keys(VERDICTS).map((look) => [look, mark()]));
  node.append(words, ...[...Object.values(marks), data, store, captures].map((one) => one.node));
  return {
    draw(view, alarms) {
      store.node.hidden = view.storeError === null;
      store.draw("bad", `Results are not being stored: ${view.storeError}`);
      captures.node.hidden = view.captureError === null;
      captures.draw("uncertain", `Samples around alarms are not kept: ${view.captureError}`);
      setText(words, emptyWords(view));
      words.hidden = words.textContent === "";
      const looks = view.units.flatMap(({ id, bearings, films }) => bearings.map(({ bearing }, n) => bearingVerdict(films[n], alarms.of(id, bearing))[0]));
      for (const [look, one] of Object.entries(marks)) {
        const n = looks.filter((each) => each === look).length;
        one.node.hidden = n === 0;
        one.draw(look, `${n} ${VERDICTS[look]}`);
      }
      drawData(data, view);
    },
  };
}

/** How many bearings have good data, apart from what the data say. */
function drawData(data, view) {
  const levels = view.units.flatMap((unit) => unit.bearings.map((bearing) => qualityOf(bearing).level));
  const n = levels.filter((level) => level === "good").length;
  data.node.hidden = levels.length === 0;
  const worst = ["bad", "uncertain", "good"].find((level) => levels.includes(level)) ?? "good";
  data.draw(worst, `Data: ${n === levels.length ? "all good" : `${n} of ${levels.length} bearings good`}`);
}

function emptyWords(view) {
  if (view.silenceS === null) return "No numbers yet: the service has not answered.";
  return view.units.length === 0 ? "The plant file names no units." : "";
}
