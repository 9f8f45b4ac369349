/** The cursor of a spectrum with its harmonics, and the list of peaks. */

import { amplitudeUnit, shownAmplitude } from "../amplitudes.js";
import { AXES, harmonicsOf, peaksOf } from "../charts/spectrum_reading.js";
import { button, element } from "../dom.js";
import { formatFixed } from "../format.js";
import { queryOf } from "../route.js";
import { keepInAddress } from "./kept_choice.js";

const WINDOW = "Hann window; peaks are interpolated between the lines, which are";
const HEADINGS = ["Hz", "cpm", "× speed"];
const ORDERS_DIGITS = [3, 1, 3];

/** Returns `{ node, hz(), draw(spectrum), choosePoint(point) }`; `hz` is null without a cursor. */
export function spectrumCursor(onChange) {
  const input = element("input", { type: "number", min: "0", id: "cursor" });
  const none = button("No cursor", () => set(null));
  const unit = element("span");
  const [harmonics, peaks] = [element("tbody"), element("tbody")];
  const note = element("p", { class: "hint" });
  const field = element("label", { class: "setting" }, "Cursor ", input, " ", unit);
  let [axis, turnHz] = [AXES.hz, null];
  let hz = Number(queryOf(location.hash).get("cursor")) || null;

  function set(toHz) {
    hz = toHz > 0 ? toHz : null;
    keepInAddress("cursor", hz === null ? null : Number(hz.toPrecision(6)));
    onChange();
  }
  input.addEventListener("change", () => set(Number(input.value) / (axis.of(1, turnHz) ?? 1)));
  return {
    node: element("div", { class: "cursor" }, element("div", { class: "choices" }, field, none), listOf("Cursor and harmonics", harmonics), listOf("Peaks", peaks), note),
    hz: () => hz,
    choosePoint: ({ x }) => set(x / (axis.of(1, turnHz) ?? 1)),
    /** `frequencyHz`, `amplitude` in µm, `order1Hz`, the axis and the lowest frequency of a peak. */
    draw({ frequencyHz, amplitude, order1Hz, axis: along, fromHz }) {
      [axis, turnHz] = [along, order1Hz];
      input.step = axis.of(frequencyHz[0], turnHz);
      unit.textContent = axis.unit;
      if (document.activeElement !== input || hz === null) input.value = hz === null ? "" : Number(axis.of(hz, turnHz)?.toPrecision(6));
      none.disabled = hz === null;
      const row = (name) => (found, n) => rowOf(name(n), found, order1Hz);
      harmonics.replaceChildren(...(hz === null ? [] : harmonicsOf(frequencyHz, amplitude, hz)).map(row((n) => `${n + 1}`)));
      peaks.replaceChildren(...peaksOf(frequencyHz, amplitude, fromHz).map(row((n) => `${n + 1}`)));
      for (const body of [harmonics, peaks]) body.parentNode.hidden = !body.childElementCount;
      note.textContent = `${WINDOW} ${formatFixed(frequencyHz[0], 4)} Hz apart. Click into the spectrum, or step the cursor with ↑ and ↓.`;
    },
  };
}

function listOf(words, body) {
  const headings = ["No.", ...HEADINGS, "Amplitude"].map((one) => element("th", { scope: "col" }, one));
  return element("table", { class: "readings" }, element("caption", {}, words), element("thead", {}, element("tr", {}, ...headings)), body);
}

function rowOf(name, { hz, um }, turnHz) {
  const places = Object.values(AXES).map(({ of }, n) => (of(hz, turnHz) === null ? "—" : formatFixed(of(hz, turnHz), ORDERS_DIGITS[n])));
  const cells = [...places, `${formatFixed(shownAmplitude(um), 2)} ${amplitudeUnit()}`].map((words) => element("td", {}, words));
  return element("tr", {}, element("th", { scope: "row" }, name), ...cells);
}
