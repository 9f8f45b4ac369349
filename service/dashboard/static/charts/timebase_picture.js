/** The same motion against time: x above, y below, the key-phase marks dotted across. */

import { canvas, palette, roundStep, strokePath } from "./canvas.js";
import { marksIn, reachOf, trailAt, trailS } from "./orbit_clip.js";

const LEFT_PX = 46;
const BOTTOM_PX = 22;
const TOP_PX = 8;

/** Returns `{ node, draw(clip, atS, how) }`, as the orbit's picture. */
export function timebasePicture() {
  const surface = canvas("timebase-canvas", "Motion of the shaft against time, x above y");
  return {
    node: surface.node,
    draw(clip, atS, how) {
      const { pen, width, height } = surface.begin();
      const colours = palette();
      const trail = trailAt(clip, atS, how.turns);
      const spanS = trailS(clip, how.turns);
      const across = (sample) => width - 8 - ((atS - clip.startS - sample / clip.rate_hz) / spanS) * (width - LEFT_PX - 8);
      const half = (height - BOTTOM_PX - TOP_PX) / 2;
      const reach = 1.1 * reachOf(clip);
      drawTime(pen, spanS, width, height, colours);
      drawMarks(pen, clip, trail, across, height, colours);
      ["x", "y"].forEach((axis, n) => {
        const middle = TOP_PX + half * (n + 0.5);
        const down = (um) => middle - (um / reach) * (half / 2);
        drawScale(pen, { axis, reach, down, width }, colours);
        const line = { first: trail.first, last: trail.last, across, down };
        if (how.whole) drawLine(pen, clip[`shaft_${axis}_um`], line, colours.x, []);
        if (how.alone && clip.order1) drawLine(pen, clip.order1[`shaft_${axis}_um`], line, colours.y, [7, 4]);
      });
    },
  };
}

function drawLine(pen, trace, { first, last, across, down }, colour, dash) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.setLineDash(dash);
  strokePath(pen, last - first + 1, (n) => (trace[first + n] === null ? null : [across(first + n), down(trace[first + n])]));
  pen.setLineDash([]);
}

function drawScale(pen, { axis, reach, down, width }, colours) {
  const step = roundStep(2 * reach, 5);
  pen.fillStyle = colours.soft;
  pen.textAlign = "right";
  pen.lineWidth = 1;
  for (let k = -Math.floor(reach / step); k <= reach / step; k += 1) {
    const um = k * step;
    pen.strokeStyle = k === 0 ? colours.faint : colours.grid;
    strokePath(pen, 2, (end) => [end ? width - 8 : LEFT_PX, down(um)]);
    pen.fillText(String(Number(um.toPrecision(3))).replace("-", "−"), LEFT_PX - 4, down(um) + 4);
  }
  pen.textAlign = "left";
  pen.fillStyle = colours.ink;
  pen.fillText(`${axis}, µm`, LEFT_PX + 4, down(reach) + 10);
}

function drawTime(pen, spanS, width, height, colours) {
  const step = roundStep(spanS, 4);
  pen.fillStyle = colours.soft;
  pen.textAlign = "center";
  for (let backS = 0; backS <= spanS + 1e-9; backS += step) {
    const x = width - 8 - (backS / spanS) * (width - LEFT_PX - 8);
    pen.textAlign = backS === 0 ? "right" : "center";
    pen.fillText(backS === 0 ? "0 s" : `−${Number(backS.toPrecision(3))} s`, backS === 0 ? width - 4 : x, height - 6);
  }
}

function drawMarks(pen, clip, trail, across, height, colours) {
  pen.strokeStyle = colours.ink;
  pen.lineWidth = 1;
  pen.setLineDash([2, 3]);
  for (const at of marksIn(clip, trail)) strokePath(pen, 2, (end) => [across(at), end ? height - BOTTOM_PX : TOP_PX]);
  pen.setLineDash([]);
}
