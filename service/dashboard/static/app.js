/** The page as a whole: who is here, polls the overview, follows the address, redraws every second. */

import { pageOf } from "./admission.js";
import { onAmplitudes } from "./amplitudes.js";
import { NotReachable, ask, onRefused } from "./api.js";
import { onUpgrade } from "./edition.js";
import { SILENCE, failedNow, heardNow, moment, viewAt } from "./live.js";
import { PAGES } from "./pages.js";
import { bar } from "./parts/bar.js";
import { poll } from "./poll.js";
import { ALARMS_ADDRESS } from "./route.js";
import { askSession, isLocked, onSession, session } from "./session.js";

const OVERVIEW_PERIOD_S = 2;
const REDRAW_PERIOD_MS = 1000;

const main = document.getElementById("main");
const head = bar(PAGES, ALARMS_ADDRESS);
let live = SILENCE;
let page = null;

async function askOverview(signal) {
  try {
    if (session() === null || isLocked()) await askSession(signal);
    if (isLocked()) live = SILENCE;
    else live = heardNow(live, await ask(["overview"], [], signal), moment());
  } catch (failure) {
    if (signal.aborted) return;
    live = failedNow(live, failureWords(failure), moment());
  }
  if (page === null) openPage();
  draw();
}

function draw() {
  const view = viewAt(live, moment());
  head.draw(view);
  page?.draw(view);
}

function failureWords(failure) {
  const what = failure instanceof NotReachable ? "Service not reachable." : "Service answers with an error.";
  return `${what} ${failure.message} Trying again every ${OVERVIEW_PERIOD_S} s.`;
}

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

/** The login or its permissions have changed. */
function changePerson() {
  openPage();
  overviews.again();
}

document.querySelector(".skip").addEventListener("click", (click) => {
  click.preventDefault();
  main.focus();
});
document.getElementById("reload").addEventListener("click", () => location.reload());
onUpgrade(() => (document.getElementById("upgrade").hidden = false));
window.addEventListener("hashchange", openPage);
onAmplitudes(openPage);
draw();
const overviews = poll(askOverview, () => OVERVIEW_PERIOD_S);
onSession(changePerson);
onRefused(() => askSession().catch(() => {})); // the overview reports an unreachable service
setInterval(draw, REDRAW_PERIOD_MS);
