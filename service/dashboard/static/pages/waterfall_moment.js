/** Which of the spectra is looked at: by a click into the picture, or with a slider from the keyboard. */

import { button, element, setAttribute } from "../dom.js";
import { formatTime } from "../format.js";
import { localMs } from "../charts/waterfall_rows.js";

/** Returns `{ node, offer(spectra, isThere), index(), choosePoint(point) }`; the newest until one is chosen. */
export function momentSlider(onChange) {
  const slider = element("input", { type: "range", min: "0", max: "0", step: "1", id: "moment" });
  const words = element("output", { for: "moment" });
  const newest = button("Newest", () => choose(offered.time.length - 1));
  const node = element("div", { class: "moment", hidden: "" }, element("label", { for: "moment" }, "Moment"), slider, words, newest);
  let offered = null;
  let chosenS = null; // null: the newest, whatever comes

  function choose(index) {
    chosenS = index === offered.time.length - 1 ? null : offered.time[index];
    show();
    onChange();
  }
  function show() {
    const index = indexOf(offered, chosenS);
    const time = formatTime(offered.time[index] * 1000);
    slider.max = String(offered.time.length - 1);
    slider.value = String(index);
    setAttribute(slider, "aria-valuetext", time);
    words.textContent = time;
    newest.disabled = chosenS === null;
  }
  slider.addEventListener("input", () => choose(Number(slider.value)));
  return {
    node,
    offer(spectra, isThere) {
      offered = spectra;
      node.hidden = !isThere;
      if (isThere) show();
    },
    index: () => indexOf(offered, chosenS),
    /** Choose the spectrum next to a point of the map. */
    choosePoint({ y }) {
      const atMs = typeof y === "number" ? y : Date.parse(`${y.replace(" ", "T")}Z`);
      choose(nearest(offered.time.map(localMs), atMs));
    },
  };
}

const indexOf = ({ time }, chosenS) => (chosenS === null ? time.length - 1 : nearest(time, chosenS));

const nearest = (times, wanted) => times.reduce((best, time, n) => (Math.abs(time - wanted) < Math.abs(times[best] - wanted) ? n : best), 0);
