/** What stands above every page: the plant, its alarms, who is here, and whether all this is current. */

import { countWords } from "../alarm_words.js";
import { setAttribute, setText } from "../dom.js";
import { formatAge, formatTime, formatZone } from "../format.js";
import { serviceTimeMs } from "../server_time.js";
import { isLocked, mustChangePassword } from "../session.js";
import { mark } from "./mark.js";
import { navigation } from "./navigation.js";
import { personView } from "./person.js";

const FRESH_S = 4; // two periods of the question
const part = (id) => document.getElementById(id);

/** Returns `{ draw(view), show(page) }`; `show` marks the page that is open. */
export function bar(pages, alarmsPattern) {
  const alarms = mark();
  const ways = navigation(pages);
  const person = personView();
  part("alarms").append(alarms.node);
  ways.node.append(person.node);
  part("bar").append(ways.button, ways.node);
  return {
    draw(view) {
      setText(part("plant"), view.plant ?? "");
      const nowMs = serviceTimeMs();
      setText(part("clock"), nowMs === null ? "" : `${formatTime(nowMs)} ${formatZone(nowMs)}`);
      setText(part("service"), serviceSentence(view));
      part("replay").hidden = view.origin !== "replay";
      part("alarms").hidden = isLocked();
      alarms.draw(...countWords(view.alarms));
      person.draw();
      ways.draw();
      drawBanner(view);
    },
    show(page) {
      setAttribute(part("alarms"), "aria-current", page.pattern === alarmsPattern ? "page" : null);
      ways.show(page);
      ways.close();
    },
  };
}

function drawBanner(view) {
  part("banner").hidden = view.failure === null;
  setText(part("failure"), view.failure ?? "");
  setText(part("failure-age"), view.failure === null ? "" : failureAge(view));
}

function serviceSentence(view) {
  if (isLocked()) return mustChangePassword() ? "The password must be changed." : "You are not logged in.";
  if (view.silenceS === null) return "Waiting for the service’s first answer.";
  return view.silenceS < FRESH_S && view.failure === null ? "Connected" : `Service answered ${formatAge(view.silenceS)} ago`;
}

function failureAge(view) {
  const numbers = view.current ? "Numbers are those of the last answer." : "No number is shown as current.";
  return `For ${formatAge(view.failedS)} now. ${numbers}`;
}
