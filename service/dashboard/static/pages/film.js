/** One film: the verdict, the baseline as a map, readings against their condition, versions. */

import { ask } from "../api.js";
import { element, setText } from "../dom.js";
import { bearingAlarms } from "../parts/alarm_brief.js";
import { poll } from "../poll.js";
import { bearingAddress, filmAddress } from "../route.js";
import { actorField } from "../parts/actor.js";
import { baselineTable } from "./baseline_table.js";
import { filmCharts } from "./film_charts.js";
import { askFilm } from "./film_summary.js";
import { verdictPanel } from "./film_verdict.js";

const PERIOD_S = 10;

/** Returns `{ draw(view), close() }`. */
export function filmPage(main, unitId, bearingId) {
  const path = ["units", unitId, "bearings", bearingId];
  const head = headPart(unitId, bearingId);
  const actor = actorField("change_measuring", "change baselines");
  const verdict = verdictPanel();
  const alarms = bearingAlarms(unitId, bearingId);
  const charts = filmCharts(path);
  const baselines = baselineTable(path, actor, () => questions.again());
  main.append(element("div", { class: "bearing film-page" }, head.node, verdict.node, alarms.node, charts.node, actor.node, baselines.node));
  const films = askFilm(path, verdict, charts.update);
  let baseline = null;

  const questions = poll(async (signal) => {
    try {
      const found = await ask([...path, "baselines"], [], signal);
      baseline = await shownBaseline(path, found, baseline, signal);
      baselines.draw(found);
      charts.learned(found, baseline);
    } catch (failure) {
      if (!signal.aborted) baselines.fail(failure.message);
    }
  }, () => PERIOD_S);

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

/** Where we are, and the way to the other films of the unit. */
function headPart(unitId, bearingId) {
  const title = element("h1", {}, `${unitId} ${bearingId}: film`);
  const nav = element("nav", { class: "siblings", "aria-label": "Films of this unit" });
  let links = "";
  return {
    node: element("header", { class: "bearing-head" }, nav, title),
    draw(view) {
      const unit = view.units.find((one) => one.id === unitId);
      if (!unit) return;
      setText(title, `${unit.name}, ${bearingId}: film against its baseline`);
      const wanted = unit.bearings.map((one) => one.bearing).join(" ");
      if (wanted === links) return;
      links = wanted;
      nav.replaceChildren(
        element("a", { href: "#/" }, "Overview"),
        element("a", { href: bearingAddress(unitId, bearingId) }, `Bearing ${bearingId}`),
        ...unit.bearings.map(({ bearing }) => siblingLink(unitId, bearing, bearing === bearingId)),
      );
    },
  };
}

function siblingLink(unit, bearing, isHere) {
  const link = element("a", { href: filmAddress(unit, bearing) }, `Film ${bearing}`);
  if (isHere) link.setAttribute("aria-current", "page");
  return link;
}
