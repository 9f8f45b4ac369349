/** Small building blocks on the browser's own document. */

const SVG = "http://www.w3.org/2000/svg";

/** Build an element; `attributes` are set as written, children may be nodes or strings. */
export function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** A button that calls `onClick`. */
export function button(words, onClick, attributes = {}) {
  const node = element("button", { type: "button", ...attributes }, words);
  node.addEventListener("click", onClick);
  return node;
}

/** Build a shape inside an SVG picture, as an element. */
export function shape(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** Change a text only when it differs, so that selections and screen readers stay undisturbed. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** A pressed button may disappear when the page is drawn: the focus then moves to its row, or to `fallback`. */
export function keepingFocus(fallback, draw) {
  const focused = document.activeElement;
  const row = focused.closest("tr, li");
  draw();
  if (focused.isConnected && !focused.closest("[hidden]")) return;
  const next = row?.isConnected ? [...row.querySelectorAll("button"), ...row.querySelectorAll("a")].find((one) => !one.closest("[hidden]")) : null;
  (next ?? fallback).focus();
}

/** Set or, with null, remove an attribute, touching the page only on a change. */
export function setAttribute(node, name, value) {
  if (value === null) node.removeAttribute(name);
  else if (node.getAttribute(name) !== value) node.setAttribute(name, value);
}
