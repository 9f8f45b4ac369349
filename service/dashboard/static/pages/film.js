/** One film: the verdict, the baseline as a map, readings against their condition, versions. */

import { ask } from "../api.js";
import { element } from "../dom.js";
import { actorField } from "../parts/actor.js";
import { bearingAlarms } from "../parts/alarm_brief.js";
import { poll } from "../poll.js";
import { filmAddress } from "../route.js";
import { baselineTable } from "./baseline_table.js";
import { bearingHead } from "./bearing_head.js";
import { filmCharts } from "./film_charts.js";
import { askFilm } from "./film_summary.js";
import { verdictPanel } from "./film_verdict.js";

const PERIOD_S = 10;

/** Returns `{ draw(view), close() }`. */
export function filmPage(main, unitId, bearingId) {
  const path = ["units", unitId, "bearings", bearingId];
  const head = bearingHead(unitId, bearingId, ": film against its baseline", filmAddress);
  const actor = actorField("change_measuring", "change baselines");
  const verdict = verdictPanel();
  const alarms = bearingAlarms(unitId, bearingId);
  const charts = filmCharts(path);
  const baselines = baselineTable(path, actor, () => questions.again());
  main.append(element("div", { class: "bearing film-page" }, head.node, verdict.node, alarms.node, charts.node, actor.node, baselines.node));
  const films = askFilm(path, verdict, charts.update);
  let baseline = null;

  const questions = poll(async (signal) => {
    const found = await ask([...path, "baselines"], [], signal);
    baseline = await shownBaseline(path, found, baseline, signal);
    baselines.draw(found);
    charts.learned(found, baseline);
  }, () => PERIOD_S, (failure) => baselines.fail(failure.message));

  return {
    draw(view) {
      head.draw(view);
      actor.draw();
      charts.draw(view);
    },
    close() {
      for (const one of [films, questions]) one.stop();
      charts.close();
      alarms.close();
    },
  };
}

/** The version in force, or else the newest; asked for only when another one is to be shown. */
async function shownBaseline(path, { in_force: inForce, versions }, shown, signal) {
  const version = inForce ?? versions.find(({ status }) => status === "learned")?.version ?? null;
  if (version === null) return null;
  const about = versions.find((one) => one.version === version);
  if (shown?.about.version === version) return { ...shown, about };
  return ask([...path, "baselines", String(version)], [], signal);
}
