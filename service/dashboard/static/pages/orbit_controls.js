/** Play, pause, step, scrub and speed: by mouse, by finger and from the keyboard. */

import { button, element, setAttribute, setText } from "../dom.js";
import { formatFixed } from "../format.js";

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8];
const STEP_TURNS = 1 / 36;
const STEPS = [["◂◂ Turn", -1], ["◂ Step", -STEP_TURNS], ["Step ▸", STEP_TURNS], ["Turn ▸▸", 1]];

/** Elements that have their own use for the space bar, and for the arrows. */
const OWN_SPACE = "button, a, select, textarea, input:not([type=range], [type=radio])";
const OWN_ARROWS = "select, textarea, input:not(#orbit-at)";

/** `acts` is `{ play(), step(turns), seek(s), hasten(speed), hold() }`. Returns `{ node, draw(at, clip, source), close() }`. */
export function orbitControls(acts) {
  const play = button("▶ Play", () => acts.play(), { class: "play" });
  const scrub = element("input", { type: "range", id: "orbit-at", step: "any", "aria-label": "Moment" });
  const speed = element("input", { type: "range", id: "orbit-speed", min: "0", max: String(SPEEDS.length - 1), step: "1" });
  const speedWords = element("output", { for: "orbit-speed" });
  const steps = STEPS.map(([words, turns]) => button(words, () => acts.step(turns)));
  const hold = button("Hold as reference", () => acts.hold(), { "aria-pressed": "false" });
  const keys = element("p", { class: "hint" }, "Space: play or pause. ← and →: a step of 10°. With Shift: a turn.");
  scrub.addEventListener("input", () => acts.seek(Number(scrub.value)));
  speed.addEventListener("input", () => acts.hasten(SPEEDS[Number(speed.value)]));

  function onKey(key) {
    const turns = { ArrowLeft: -1, ArrowRight: 1 }[key.key];
    if ((key.key !== " " && !turns) || key.ctrlKey || key.altKey || key.metaKey) return;
    if (key.target.closest?.(turns ? OWN_ARROWS : OWN_SPACE)) return;
    if (!turns) acts.play();
    else acts.step(turns * (key.shiftKey ? 1 : STEP_TURNS));
    key.preventDefault();
  }
  document.addEventListener("keydown", onKey);
  return {
    node: element(
      "div",
      { class: "player-controls" },
      element("div", { class: "player-buttons" }, play, ...steps, hold),
      scrub,
      element("label", { class: "setting" }, "Speed ", speed, " ", speedWords),
      keys,
    ),
    draw(at, clip, source, reference) {
      setAttribute(hold, "aria-pressed", String(reference !== null));
      setText(play, at.isPlaying ? "‖ Pause" : "▶ Play");
      setText(speedWords, `${at.speed}×`);
      setAttribute(speed, "aria-valuetext", `${at.speed} times`);
      speed.value = String(SPEEDS.indexOf(at.speed));
      scrub.disabled = clip === null;
      if (clip === null) return;
      const [low, high] = source.isLive ? [clip.startS, clip.endS] : [0, clip.total_s];
      [scrub.min, scrub.max, scrub.value] = [String(low), String(high), String(at.atS)];
      setAttribute(scrub, "aria-valuetext", source.isLive ? `${formatFixed(high - at.atS, 1)} s ago` : `${formatFixed(at.atS, 1)} s`);
    },
    close() {
      document.removeEventListener("keydown", onKey);
    },
  };
}
