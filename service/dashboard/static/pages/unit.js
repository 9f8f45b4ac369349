/** One generating unit: how it runs, what is wrong, and its bearings side by side. */

import { element } from "../dom.js";
import { unitAlarms } from "../parts/alarm_brief.js";
import { recordingsBrief } from "../parts/recordings_brief.js";
import { unitHead } from "./unit_head.js";
import { unitTable } from "./unit_table.js";

/** Returns `{ draw(view), close() }`. */
export function unitPage(main, unitId) {
  const missing = element("p", { class: "sentence" });
  const content = element("div", { class: "unit-page", hidden: "" });
  main.append(missing, content);
  let parts = null;

  function build(unit) {
    parts = [unitHead(unitId), unitAlarms(unitId), recordingsBrief(unitId), unitTable(unit)];
    content.replaceChildren(...parts.map((part) => part.node));
  }

  return {
    draw(view) {
      const unit = view.units.find((one) => one.id === unitId);
      const isWhole = unit?.bearings.every((bearing) => bearing.isWhole) ?? false;
      content.hidden = !isWhole;
      missing.hidden = isWhole;
      if (!isWhole) missing.replaceChildren(missingSentence(view, unit, unitId), " ", element("a", { href: "#/" }, "Overview"));
      else if (parts === null) build(unit);
      if (isWhole) for (const part of parts) part.draw(unit, view);
    },
    close() {
      for (const part of parts ?? []) part.close?.();
    },
  };
}

function missingSentence(view, unit, unitId) {
  if (view.silenceS === null) return "No numbers yet: the service has not answered.";
  if (unit) return "Asking the service.";
  return `This plant has no unit ${unitId}.`;
}
