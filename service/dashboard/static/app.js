/** The page as a whole: who is here, polls the overview, follows the address, redraws every second. */

import { pageOf } from "./admission.js";
import { onAmplitudes } from "./amplitudes.js";
import { NotReachable, ask, onRefused } from "./api.js";
import { onUpgrade } from "./edition.js";
import { loadCatalogue } from "./catalogue.js";
import { SILENCE, failedNow, heardNow, merged, moment, viewAt } from "./live.js";
import { PAGES } from "./pages.js";
import { bar } from "./parts/bar.js";
import { poll } from "./poll.js";
import { ALARMS_ADDRESS } from "./route.js";
import { serviceTimeMs } from "./server_time.js";
import { askSession, isLocked, onSession, session } from "./session.js";

const [OVERVIEW_PERIOD_S, RETRY_PERIOD_S, REDRAW_PERIOD_S] = [2, 1, 1];

const main = document.getElementById("main");
const head = bar(PAGES, ALARMS_ADDRESS);
let live = SILENCE;
let page = null;

async function askOverview(signal) {
  try {
    if (session() === null || isLocked()) await askSession(signal);
    live = isLocked() ? SILENCE : await heard(signal);
  } catch (failure) {
    if (failure.status === 401) await askSession(signal).catch(() => {}); // a login that is over is no fault
    if (signal.aborted) return;
    live = failure.status === 401 && isLocked() ? SILENCE : failedNow(live, failureWords(failure), moment());
  }
  if (page === null) openPage();
  else draw();
}

async function heard(signal) {
  const since = live.overview ? [["since", live.overview.revision]] : [];
  const [news] = await Promise.all([ask(["overview"], since, signal), loadCatalogue(signal)]);
  const overview = merged(live.overview, news);
  return heardNow(overview, await detailsOf(overview, signal), moment());
}

/**
 * What the open page shows beyond tiles: `sources` by unit, and `latest` results by `unit/bearing`.
 *
 * Only a page about a unit or bearing does.
 */
async function detailsOf(overview, signal) {
  const { page: wanted, segments } = pageOf(location.hash);
  const details = { sources: new Map(), latest: new Map() };
  const [unitId, bearingId] = wanted.pattern?.startsWith("#/units/") ? segments : [];
  const unit = overview.units.find(({ id }) => id === unitId);
  if (!unit) return details;
  const bearings = unit.bearings.map(({ bearing }) => bearing).filter((bearing) => bearingId === undefined || bearing === bearingId);
  const path = ["units", unitId];
  const [{ source }, ...latest] = await Promise.all([path, ...bearings.map((bearing) => [...path, "bearings", bearing, "latest"])].map((one) => ask(one, [], signal)));
  details.sources.set(unitId, source);
  for (const one of latest) details.latest.set(`${unitId}/${one.bearing}`, one);
  return details;
}

function draw() {
  const view = viewAt(live, moment(), serviceTimeMs());
  head.draw(view);
  page?.draw(view);
}

const failureWords = (failure) =>
  `${failure instanceof NotReachable ? "" : "Service answers with an error. "}${failure.message} Trying again every ${RETRY_PERIOD_S} s.`;

function openPage() {
  const { page: wanted, segments } = pageOf(location.hash);
  page?.close();
  main.replaceChildren();
  page = wanted.open(main, ...segments);
  document.title = `padwatch: ${typeof wanted.title === "function" ? wanted.title(...segments) : wanted.title}`;
  head.show(wanted);
  window.scrollTo(0, 0);
  draw();
}

/** The address, the login or its permissions have changed. */
function changePage() {
  openPage();
  overviews.again();
}

document.querySelector(".skip").addEventListener("click", (click) => {
  click.preventDefault();
  main.focus();
});
document.getElementById("reload").addEventListener("click", () => location.reload());
onUpgrade(() => (document.getElementById("upgrade").hidden = false));
window.addEventListener("hashchange", changePage);
onAmplitudes(openPage);
draw();
const overviews = poll(askOverview, () => (live.failure === null ? OVERVIEW_PERIOD_S : RETRY_PERIOD_S));
onSession(changePage);
onRefused(() => askSession().catch(() => {})); // the overview reports an unreachable service
setInterval(draw, REDRAW_PERIOD_S * 1000);
