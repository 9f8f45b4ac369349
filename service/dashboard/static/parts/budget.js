/** Uncertainty budget of one result, requested only while it is open. */

import { ask } from "../api.js";
import { button, element, setText } from "../dom.js";
import { formatInterval, formatQuantity, formatSignificant, formatTime, kindOf } from "../format.js";
import { poll } from "../poll.js";
import { listingCell, listingName, tableOf } from "./listing.js";

const PERIOD_S = 5;
const MORE_DECIMALS = 2;
const HEADS = ["Contribution", "Kind", "Distribution", "Width", "Standard uncertainty"];
const READING_HELP =
  "Random parts differ from one result to the next; systematic ones stay. Width: standard uncertainty if normal, " +
  "half-width if uniform, of what contributes: a share of it, or in µm.";

let nPanels = 0;

/** Returns `{ node, id, toggle(quantity, label, opener), close() }`; one budget at a time. */
export function budgetPanel(path) {
  const id = `budget-${(nPanels += 1)}`;
  const title = element("h3");
  const closing = button("Close", leave, { class: "closing" });
  const sentence = element("p", { class: "sentence", role: "status" });
  const table = tableOf("Uncertainty budget", HEADS);
  const help = element("p", { class: "help" }, READING_HELP);
  const head = element("div", { class: "panel-head" }, title, closing);
  const node = element("section", { class: "budget", id, hidden: "" }, head, sentence, table, help);
  let open = null;

  function close() {
    open?.questions.stop();
    open?.opener.setAttribute("aria-expanded", "false");
    open = null;
    node.hidden = true;
  }

  function show(budget) {
    table.hidden = help.hidden = budget === null;
    if (budget === null) return;
    setText(sentence, budgetSentence(budget));
    table.tBodies[0].replaceChildren(...budget.lines.map((line) => budgetRow(budget.quantity, line)));
  }

  function fail(failure) {
    show(null);
    setText(sentence, `No budget now. ${failure.message}`);
  }

  function toggle(quantity, label, opener) {
    const same = open?.opener === opener;
    close();
    if (same) return;
    setText(title, `Uncertainty budget: ${label}`);
    show(null);
    setText(sentence, "Asking the service.");
    node.hidden = false;
    node.dataset.quantity = quantity;
    opener.setAttribute("aria-expanded", "true");
    const refresh = async (signal) => show(await ask([...path, "budgets", quantity], [], signal));
    open = { opener, questions: poll(refresh, () => PERIOD_S, fail) };
  }

  function leave() {
    const opener = open?.opener;
    close();
    opener?.focus();
  }
  return { node, id, toggle, close };
}

function budgetRow(quantity, line) {
  const contents = [line.kind, line.distribution, widthWords(quantity, line), withUnit(quantity, line.contribution)];
  const cells = contents.map((words, index) => listingCell(HEADS[index + 1], words));
  return element("tr", { role: "row", "data-kind": line.kind }, listingName(line.name), ...cells);
}

const united = (quantity, digits) => `${digits} ${kindOf(quantity).unit}`.trimEnd();
const withUnit = (quantity, value) => united(quantity, formatQuantity(quantity, value, MORE_DECIMALS));

/** Spectral statistics are stated in the unit of the result itself: nothing lies between. */
function widthWords(quantity, { kind, width }) {
  return kind === "random" ? withUnit(quantity, width) : formatSignificant(width);
}

function budgetSentence({ quantity, value, uncertainty, time }) {
  const interval = united(quantity, formatInterval(quantity, uncertainty));
  return (
    `${united(quantity, formatQuantity(quantity, value))}, 95 %: ${interval}. ` +
    `Standard uncertainty: random ${withUnit(quantity, uncertainty.random)}, ` +
    `systematic ${withUnit(quantity, uncertainty.systematic)}. Samples up to ${formatTime(Date.parse(time))}.`
  );
}
