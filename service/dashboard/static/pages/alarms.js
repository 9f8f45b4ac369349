/** Alarm list: active, acknowledged and hidden alarms, and the history. */

import { conditionWords, isHidden } from "../alarm_words.js";
import { ask } from "../api.js";
import { element, keepingFocus, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { CURRENT_LIMIT_S, moment, secondsBetween } from "../live.js";
import { actorField } from "../parts/actor.js";
import { deliveryView } from "../parts/delivery.js";
import { mark } from "../parts/mark.js";
import { poll } from "../poll.js";
import { alarmFilter } from "./alarm_filter.js";
import { groupAcknowledge } from "./alarm_group.js";
import { historyTable } from "./alarm_history.js";
import { ratesLine } from "./alarm_rates.js";
import { alarmTable } from "./alarm_table.js";

const LIST_PERIOD_S = 2;
const HISTORY_PERIOD_S = 5;
const RATES_PERIOD_S = 60;
const N_EVENTS = "50";

/** Returns `{ draw(view), close() }`. */
export function alarmsPage(main) {
  const state = mark();
  const actor = actorField("act_on_alarms", "act on alarms");
  const done = element("span", { class: "done", role: "status" });
  const again = (sentence) => {
    setText(done, sentence ?? "");
    for (const each of [lists, histories]) each.again();
  };
  const selected = new Set();
  const group = groupAcknowledge(again);
  const filter = alarmFilter(() => again(null));
  const filtered = element("p", { class: "sentence", hidden: "" });
  const onCell = filter.toCell;
  const onSelect = (id, isSelected) => {
    selected[isSelected ? "add" : "delete"](id);
    group.draw(shown, selected);
  };
  const above = element("div", {}, filtered, group.node);
  const listed = alarmTable("Active alarms", "No alarms.", again, { above, onSelect, onCell });
  const hidden = alarmTable("Shelved and suppressed", "Nothing is shelved, suppressed or out of service.", again, { onCell });
  const unjudged = unjudgedView();
  const rates = ratesLine();
  const history = historyTable(filter);
  const head = element("div", { class: "alarms-head" }, element("h1", { tabindex: "-1" }, "Alarms"), state.node, done, actor.node);
  const delivery = deliveryView();
  main.append(head, delivery.node, filter.node, listed.node, unjudged.node, hidden.node, rates.node, history.node);
  let receivedAt = null;
  let failure = null;
  let shown = [];

  function draw() {
    const silenceS = receivedAt ? secondsBetween(receivedAt, moment()) : null;
    const current = silenceS !== null && silenceS <= CURRENT_LIMIT_S;
    state.node.hidden = current && failure === null;
    state.draw("bad", silenceWords(silenceS, failure));
    for (const table of [listed, hidden]) table.setCurrent(current);
    actor.draw();
  }

  async function askList(signal) {
    const found = await ask(["alarms"], filter.query(), signal);
    [receivedAt, failure] = [moment(), null];
    const alarms = filter.sorted(found.alarms);
    shown = alarms.filter((alarm) => !isHidden(alarm));
    keepingFocus(main.querySelector("h1"), () => {
      listed.draw(shown);
      hidden.draw(alarms.filter(isHidden));
      group.draw(shown, selected);
    });
    filtered.hidden = filter.query().length === 0;
    setText(filtered, `Filtered: only alarms that match are shown; ${found.count.n_active} of the plant are active.`);
    unjudged.draw(found.unjudged);
    draw();
  }

  /** Keep a part of the page up to date with the answer at `path`. */
  function polled(part, periodS, path, queryOf = () => []) {
    const refresh = async (signal) => part.draw(await ask(path, queryOf(), signal));
    return poll(refresh, () => periodS, (error) => part.fail(error.message));
  }

  const lists = poll(askList, () => LIST_PERIOD_S, (error) => {
    failure = error.message;
    draw();
  });
  const histories = polled(history, HISTORY_PERIOD_S, ["alarms", "events"], () => [["limit", N_EVENTS], ...filter.eventQuery()]);
  const counts = polled(rates, RATES_PERIOD_S, ["alarms", "rates"]);
  const deliveries = polled(delivery, HISTORY_PERIOD_S, ["delivery"]);
  return {
    draw,
    close() {
      for (const questions of [lists, histories, counts, deliveries]) questions.stop();
    },
  };
}

function silenceWords(silenceS, failure) {
  if (silenceS === null) return failure ?? "Waiting for the list.";
  return `This list is ${formatAge(silenceS)} old: what has happened since is not known. ${failure ?? ""}`;
}

/** Alarms that are not active as far as was known last, but whose condition is not known now. */
function unjudgedView() {
  const title = element("summary", {});
  const list = element("ul", {});
  const node = element("details", { class: "panel unjudged", hidden: "" }, title, list);
  return {
    node,
    draw(alarms) {
      node.hidden = alarms.length === 0;
      setText(title, `${alarms.length} alarms cannot be evaluated now (last known: inactive)`);
      const wanted = alarms.map((alarm) => `${alarm.id}: ${conditionWords(alarm)}`);
      while (list.childElementCount > wanted.length) list.lastChild.remove();
      wanted.forEach((words, n) => setText(list.children[n] ?? list.appendChild(element("li")), words));
    },
  };
}
