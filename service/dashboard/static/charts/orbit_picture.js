/** The orbit: path of the shaft over the last turns, in its clearance circle or by itself. */

import { canvas, palette, roundStep, strokePath } from "./canvas.js";
import { marksIn, reachOf, trailAt } from "./orbit_clip.js";

const EDGE_PX = 34;

/** Samples in which a trail is drawn at once, the older ones fainter. */
const PIECES = 12;

/** A key-phase mark as Bently draws it: the line is blank before the dot. */
const BLANK_SHARE = 0.03;

/** Returns `{ node, draw(clip, atS, how) }`; `how` is `{ turns, whole, alone, inClearance, reference }`. */
export function orbitPicture() {
  const surface = canvas("orbit-canvas", "Orbit of the shaft");
  return {
    node: surface.node,
    draw(clip, atS, how) {
      const { pen, width, height } = surface.begin();
      const colours = palette();
      const plane = planeOf(clip, how, width, height);
      drawAxes(pen, plane, colours);
      if (how.inClearance) drawClearance(pen, plane, clip, colours);
      const trail = trailAt(clip, atS, how.turns);
      if (how.whole) drawTrail(pen, plane, clip, trail, colours.x);
      if (how.alone && clip.order1) drawAlone(pen, plane, clip, trailAt(clip, atS, 1), colours.y);
      if (how.reference) drawReference(pen, plane, how, colours.mark);
      drawArrow(pen, plane, clip, trail.last, how, colours);
      drawMarks(pen, plane, clip, trail, how, colours);
      drawNow(pen, plane, clip, trail.last, how, colours);
    },
  };
}

/** How µm become pixels: the same in both directions. */
function planeOf(clip, { inClearance, reference }, width, height) {
  const centre = (inClearance && clip.centre_um) || [0, 0];
  const far = Math.max(reachOf(clip), reference ? reachOf(reference.clip) : 0);
  const reach = inClearance ? Math.max(clip.clearance_um, Math.hypot(...centre) + far) * 1.06 : 1.15 * far;
  // a surface that has not got its size yet is smaller than its edges
  const scale = Math.max(Math.min(width, height) / 2 - EDGE_PX, 0) / reach;
  const at = (x, y) => [width / 2 + x * scale, height / 2 - y * scale];
  return { reach, scale, at, of: (x, y) => (x === null || y === null ? null : at(x + centre[0], y + centre[1])), centre };
}

function drawAxes(pen, { reach, at }, colours) {
  const step = roundStep(2 * reach, 6);
  const n = Math.floor(reach / step);
  pen.fillStyle = colours.soft;
  for (let k = -n; k <= n; k += 1) {
    const um = k * step;
    pen.strokeStyle = k === 0 ? colours.faint : colours.grid;
    pen.lineWidth = 1;
    strokePath(pen, 2, (end) => at(um, end ? reach : -reach));
    strokePath(pen, 2, (end) => at(end ? reach : -reach, um));
    const [x, bottom] = at(um, -reach);
    const [left, y] = at(-reach, um);
    const words = String(Number(um.toPrecision(3))).replace("-", "−");
    pen.textAlign = "center";
    pen.fillText(words, x, bottom + 14);
    pen.textAlign = "right";
    pen.fillText(words, left - 4, y + 4);
  }
  pen.textAlign = "left";
  const [right, low] = at(reach, -reach);
  pen.fillText("x, µm", right - 30, low + 28);
  const [left, top] = at(-reach, reach);
  pen.fillText("y, µm", left, top - 6);
}

function drawClearance(pen, { at, scale, centre }, clip, colours) {
  const [x, y] = at(0, 0);
  pen.strokeStyle = colours.ink;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.arc(x, y, clip.clearance_um * scale, 0, 2 * Math.PI);
  pen.stroke();
  if (clip.centre_um === null) return;
  const [cx, cy] = at(...centre);
  pen.lineWidth = 1;
  strokePath(pen, 2, (end) => [cx + (end ? 5 : -5), cy]);
  strokePath(pen, 2, (end) => [cx, cy + (end ? 5 : -5)]);
}

/** Samples of the clip at which the line is blank, because a mark is about to come. */
function isBlank(marks, sample, nTurn) {
  return marks.some((at) => sample < at && at - sample < BLANK_SHARE * nTurn);
}

function drawTrail(pen, plane, clip, { first, last }, colour) {
  const marks = marksIn(clip, { first, last });
  const nTurn = (clip.turnS ?? 1) * clip.rate_hz;
  const length = Math.max(Math.ceil((last - first) / PIECES), 1);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  for (let start = first; start < last; start += length) {
    pen.globalAlpha = 0.25 + 0.75 * ((start - first) / Math.max(last - first, 1)) ** 2;
    strokePath(pen, Math.min(length, last - start) + 1, (n) => {
      const at = start + n;
      return isBlank(marks, at, nTurn) ? null : plane.of(clip.shaft_x_um[at], clip.shaft_y_um[at]);
    });
  }
  pen.globalAlpha = 1;
}

function drawAlone(pen, plane, { order1 }, { first, last }, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.setLineDash([7, 4]);
  strokePath(pen, last - first + 1, (n) => plane.of(order1.shaft_x_um[first + n], order1.shaft_y_um[first + n]));
  pen.setLineDash([]);
}

/** A turn that was kept: at its own place in the clearance, about the same middle to fit. */
function drawReference(pen, { at }, { reference: { clip, first, last }, inClearance, whole }, colour) {
  const [x, y] = (inClearance && clip.centre_um) || [0, 0];
  const traces = whole ? clip : (clip.order1 ?? clip);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  pen.setLineDash([2, 3]);
  strokePath(pen, last - first + 1, (n) => {
    const [u, v] = [traces.shaft_x_um[first + n], traces.shaft_y_um[first + n]];
    return u === null || v === null ? null : at(x + u, y + v);
  });
  pen.setLineDash([]);
}

/** The way the shaft runs: a head on the path, a third of a turn ago. */
function drawArrow(pen, plane, clip, last, { whole, alone }, colours) {
  const nTurn = (clip.turnS ?? 1) * clip.rate_hz;
  const is1x = alone && clip.order1;
  const traces = is1x ? clip.order1 : whole ? clip : null;
  const [from, to] = [0.36, 0.33].map((turns) => Math.round(last - turns * nTurn)).map((n) => traces && plane.of(traces.shaft_x_um[n] ?? null, traces.shaft_y_um[n] ?? null));
  if (!from || !to) return;
  pen.save();
  pen.translate(...to);
  pen.rotate(Math.atan2(to[1] - from[1], to[0] - from[0]));
  pen.fillStyle = is1x ? colours.y : colours.x;
  pen.fill(new Path2D("M 9 0 L -7 6 L -4 0 L -7 -6 Z"));
  pen.restore();
}

function drawMarks(pen, plane, clip, trail, { whole, alone }, colours) {
  for (const at of marksIn(clip, trail)) {
    if (whole) drawDot(pen, plane.of(clip.shaft_x_um[Math.round(at)], clip.shaft_y_um[Math.round(at)]), 4, colours.x);
  }
  const newest = marksIn(clip, trail).at(-1);
  if (alone && clip.order1 && newest !== undefined) {
    const n = Math.round(newest);
    drawDot(pen, plane.of(clip.order1.shaft_x_um[n], clip.order1.shaft_y_um[n]), 5, colours.y);
  }
}

function drawNow(pen, plane, clip, last, { whole }, colours) {
  const traces = whole ? clip : clip.order1;
  const point = traces && plane.of(traces.shaft_x_um[last], traces.shaft_y_um[last]);
  if (!point) return;
  pen.strokeStyle = colours.ink;
  pen.fillStyle = colours.plot;
  pen.lineWidth = 2.5;
  pen.beginPath();
  pen.arc(...point, 6, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
}

function drawDot(pen, point, radius, colour) {
  if (!point) return;
  pen.fillStyle = colour;
  pen.beginPath();
  pen.arc(...point, radius, 0, 2 * Math.PI);
  pen.fill();
}
