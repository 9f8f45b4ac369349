/** The film's full 2×2 stiffness and damping by the broadband estimate, and what the fit rests on. */

import { element } from "../dom.js";
import { budgetPanel } from "../parts/budget.js";
import { drawQuality, mark } from "../parts/mark.js";
import { pairView, readingOf, readingView } from "../parts/reading.js";
import { budgetSpread } from "../parts/spread.js";
import { qualityOf } from "../words.js";

const AXES = ["xx", "xy", "yx", "yy"];
const HELP =
  "Force on the shaft in x and y by its motion in x and y. Lack of fit is about 1 where one constant film explains " +
  "the motion at all these frequencies.";

/** Returns `{ node, draw(latest), close() }`. */
export function filmMatrices(path) {
  const budget = budgetPanel(path);
  const quality = mark();
  const stiffness = matrix("K", "GN/m", (axes) => `dynamic_k_${axes}_n_per_m`, budget);
  const damping = matrix("C", "MN·s/m", (axes) => `dynamic_c_${axes}_n_s_per_m`, budget);
  const lines = readingView("dynamic_n_lines", "");
  const fit = pairView(["dynamic_lack_of_fit_x", "dynamic_lack_of_fit_y"], ["x", "y"]);
  const facts = element("dl", { class: "facts" }, fact("Spectral lines", lines), fact("Lack of fit", fit));
  const parts = [stiffness, damping, lines, fit];
  const head = element("div", { class: "panel-head" }, element("h2", {}, "Film coefficients (broadband estimate)"), quality.node);
  const body = element("div", { class: "matrices" }, stiffness.node, damping.node, facts);
  return {
    node: element("section", { class: "panel film" }, head, body, element("p", { class: "help" }, HELP), budget.node),
    draw(latest) {
      const whole = readingOf(latest, "dynamic_k_xx_n_per_m");
      drawQuality(quality, whole, qualityOf(latest).reason);
      for (const part of parts) part.draw(latest, whole.reason);
    },
    close: budget.close,
  };
}

function matrix(letter, unit, nameOf, budget) {
  const views = AXES.map((axes) => readingView(nameOf(axes), axes, "", budgetSpread(nameOf(axes), budget)));
  const cells = element("div", { class: "cells" }, ...views.map((view) => view.node));
  return {
    node: element("div", { class: "matrix" }, element("h3", {}, letter, " ", element("small", {}, unit)), cells),
    draw(latest, saidReason) {
      for (const view of views) view.draw(latest, saidReason);
    },
  };
}

const fact = (name, view) => element("div", {}, element("dt", {}, name), element("dd", {}, view.node));
