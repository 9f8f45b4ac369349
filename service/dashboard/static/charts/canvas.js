/** A drawing surface that keeps to its size on the page and to the screen's dots. */

import { element } from "../dom.js";
import { colourOf } from "../theme.js";

/** Returns `{ node, begin() }`; `begin` clears it and gives `{ pen, width, height }` in CSS pixels. */
export function canvas(name, label) {
  const node = element("canvas", { class: `canvas ${name}`, role: "img", "aria-label": label });
  return {
    node,
    begin() {
      const { clientWidth: width, clientHeight: height } = node;
      const dots = globalThis.devicePixelRatio || 1;
      const [wide, high] = [Math.round(width * dots), Math.round(height * dots)];
      if (node.width !== wide || node.height !== high) [node.width, node.height] = [wide, high];
      const pen = node.getContext("2d");
      pen.setTransform(dots, 0, 0, dots, 0, 0);
      pen.clearRect(0, 0, width, height);
      pen.font = "12px system-ui, sans-serif";
      pen.lineJoin = "round";
      return { pen, width, height };
    },
  };
}

/** Colours as they are now, by name; asked for once a drawing, not once a line. */
export function palette() {
  const of = (name) => colourOf(`--${name}`);
  const [ink, soft, plot, grid, faint] = ["ink", "soft", "plot", "chart-grid", "chart-faint"].map(of);
  return { ink, soft, plot, grid, faint, x: of("chart-x"), y: of("chart-y"), mark: of("chart-mark") };
}

/** A round step that parts a length into about so many pieces. */
export function roundStep(length, pieces) {
  const rough = length / pieces;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((step) => step * power >= rough) * power;
}

/** A line through points `[x, y]`; a missing point interrupts it. */
export function strokePath(pen, n, pointAt) {
  pen.beginPath();
  let isDown = false;
  for (let at = 0; at < n; at += 1) {
    const point = pointAt(at);
    if (point === null) isDown = false;
    else if (isDown) pen.lineTo(...point);
    else {
      pen.moveTo(...point);
      isDown = true;
    }
  }
  pen.stroke();
}
