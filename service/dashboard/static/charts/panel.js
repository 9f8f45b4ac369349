/** The frame of a chart: a chart with a caption, or a sentence why there is none. Never blank. */

import { NotReachable } from "../api.js";
import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { mark } from "../parts/mark.js";
import { onTheme } from "../theme.js";
import { plotly } from "./plotly.js";
import { CONFIG, coloured } from "./style.js";

let queue = Promise.resolve();

/** Resolves when it is the turn of a chart: each is painted before the next one is made. */
const turn = () => (queue = queue.then(() => new Promise((resolve) => setTimeout(resolve))));

/** Returns `{ node, show(traces, layout, caption), explain(sentence), trouble(sentence), fail(failure), draw(ageS, currentWords) }`. */
export function panel(title, name, ...controls) {
  const chart = element("div", { class: "chart", hidden: "" });
  const sentence = element("p", { class: "sentence" }, "Asking the service.");
  const caption = element("span");
  const freshness = mark();
  freshness.node.hidden = true;
  const foot = element("figcaption", { hidden: "" }, freshness.node, caption);
  const node = element(
    "figure",
    { class: "panel figure", "data-chart": name },
    element("div", { class: "panel-head" }, element("h2", {}, title), ...controls),
    chart,
    sentence,
    foot,
  );
  let trouble = null;
  let shown = null;

  async function redraw(library) {
    await library.react(chart, coloured(shown.traces), coloured(shown.layout), CONFIG);
    chart.removeAllListeners("plotly_click");
    chart.on("plotly_click", ({ points }) => node.dispatchEvent(new CustomEvent("point", { detail: points[0] })));
  }

  const stop = onTheme(async () => {
    if (!node.isConnected) stop();
    else if (shown !== null) await redraw(await plotly());
  });
  return {
    node,
    /** A question failed: the service does not answer, or refuses. */
    fail(failure) {
      this[failure instanceof NotReachable ? "trouble" : "explain"](failure.message);
    },
    async show(traces, layout, words) {
      const library = await plotly();
      await turn();
      reveal(chart, sentence, foot, true);
      chart.setAttribute("role", "img");
      chart.setAttribute("aria-label", `${title}. ${words}`);
      setText(caption, words);
      trouble = null;
      shown = { traces, layout };
      await redraw(library);
    },
    explain(words) {
      reveal(chart, sentence, foot, false);
      setText(sentence, words);
      [trouble, shown] = [null, null];
    },
    /** The newest question failed: a chart already drawn stays, and says that it is old. */
    trouble(words) {
      if (chart.hidden) setText(sentence, words);
      trouble = words;
    },
    /** Called every second; `notCurrent` says why the data are not current, or null. */
    draw(ageS, notCurrent) {
      const words = trouble ?? notCurrent;
      freshness.node.hidden = words === null;
      if (words === null) return;
      const age = ageS === null ? "" : ` Drawn from data ${formatAge(ageS)} old.`;
      freshness.draw("bad", `Not current: ${words}${age}`);
    },
  };
}

function reveal(chart, sentence, foot, drawn) {
  chart.hidden = !drawn;
  foot.hidden = !drawn;
  sentence.hidden = drawn;
}
