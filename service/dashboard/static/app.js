/** The page as a whole: polls the overview, follows the address, redraws every second. */

import { countWords } from "./alarm_words.js";
import { onAmplitudes } from "./amplitudes.js";
import { NotReachable, ask } from "./api.js";
import { onUpgrade } from "./edition.js";
import { formatAge, formatTime, formatZone } from "./format.js";
import { setAttribute, setText } from "./dom.js";
import { SILENCE, failedNow, heardNow, moment, viewAt } from "./live.js";
import { poll } from "./poll.js";
import { ALARMS_ADDRESS, routeOf } from "./route.js";
import { NO_PAGE, PAGES } from "./pages.js";
import { mark } from "./parts/mark.js";
import { navigation } from "./parts/navigation.js";

const OVERVIEW_PERIOD_S = 2;
const REDRAW_PERIOD_MS = 1000;

const main = document.getElementById("main");
const banner = document.getElementById("banner");
const alarmLink = document.getElementById("alarms");
const alarms = mark();
alarmLink.append(alarms.node);
const ways = navigation(PAGES);
document.getElementById("bar").append(ways.button, ways.node);
let live = SILENCE;
let page = null;

async function askOverview(signal) {
  try {
    live = heardNow(live, await ask(["overview"], [], signal), moment());
  } catch (failure) {
    if (signal.aborted) return;
    live = failedNow(live, failureWords(failure), moment());
  }
  draw();
}

function draw() {
  const view = viewAt(live, moment());
  drawBar(view);
  page.draw(view);
}

function drawBar(view) {
  setText(document.getElementById("plant"), view.plant ?? "");
  setText(document.getElementById("clock"), `${formatTime(Date.now())} ${formatZone(Date.now())}`);
  setText(document.getElementById("service"), serviceSentence(view));
  document.getElementById("replay").hidden = view.origin !== "replay";
  alarms.draw(...countWords(view.alarms));
  banner.hidden = view.failure === null;
  setText(document.getElementById("failure"), view.failure ?? "");
  setText(document.getElementById("failure-age"), view.failure === null ? "" : failureAge(view));
}

function serviceSentence(view) {
  if (view.silenceS === null) return "Waiting for the service’s first answer.";
  return `Service answered ${formatAge(view.silenceS)} ago`;
}

function failureWords(failure) {
  const what = failure instanceof NotReachable ? "Service not reachable." : "Service answers with an error.";
  return `${what} ${failure.message} Trying again every ${OVERVIEW_PERIOD_S} s.`;
}

function failureAge(view) {
  const numbers = view.current ? "Numbers are those of the last answer." : "No number is shown as current.";
  return `For ${formatAge(view.failedS)} now. ${numbers}`;
}

function openPage() {
  const { page: wanted, segments } = routeOf(location.hash, PAGES) ?? { page: NO_PAGE, segments: [] };
  page?.close();
  main.replaceChildren();
  page = wanted.open(main, ...segments);
  document.title = `padwatch: ${typeof wanted.title === "function" ? wanted.title(...segments) : wanted.title}`;
  setAttribute(alarmLink, "aria-current", wanted.pattern === ALARMS_ADDRESS ? "page" : null);
  ways.show(wanted);
  ways.close();
  window.scrollTo(0, 0);
  draw();
}

document.querySelector(".skip").addEventListener("click", (click) => {
  click.preventDefault();
  main.focus();
});
document.getElementById("reload").addEventListener("click", () => location.reload());
onUpgrade(() => (document.getElementById("upgrade").hidden = false));
window.addEventListener("hashchange", openPage);
onAmplitudes(openPage);
openPage();
poll(askOverview, () => OVERVIEW_PERIOD_S);
setInterval(draw, REDRAW_PERIOD_MS);
