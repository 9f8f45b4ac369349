/** Versions of a bearing's baseline: where each comes from, where it stands, and what may be done. */

import { button, element, setAttribute, setText } from "../dom.js";
import { learningSentence } from "../film_words.js";
import { formatTime } from "../format.js";
import { listing, listingCell } from "../parts/listing.js";
import { mark } from "../parts/mark.js";
import { estimatorWords } from "../words.js";
import { baselineForm } from "./baseline_form.js";

const HEADS = ["Version", "Status", "Learned from", "Learned", "Remark", ""];
const STEP_HEADS = ["Time", "What", "Version", "By", "Reason"];
const STATUS = {
  in_force: ["good", "In force"],
  learned: ["uncertain", "Waits for an engineer"],
  rejected: ["absent", "Rejected"],
  superseded: ["absent", "Superseded"],
};

/** Returns `{ node, draw(baselines), fail(sentence) }`; `again` asks for the baselines afresh. */
export function baselineTable(path, actor, again) {
  const form = baselineForm(path, again);
  const learning = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const freeze = button("Freeze…", () => form.open("freeze", null, freeze));
  const thaw = button("Thaw…", () => form.open("thaw", null, thaw));
  const renew = button("Renew after a machine event…", () => form.open("renew", null, renew));
  const buttons = element("div", { class: "actions", hidden: "" }, freeze, thaw, renew);
  const versions = listing("Baselines", HEADS, "None yet.", (one) => JSON.stringify(one), (version) => versionRow(version, path, form, actor.may));
  const steps = listing("What was done", STEP_HEADS, "None yet.", (one) => JSON.stringify(one), stepRow);
  const head = element("div", { class: "baselines-head" }, element("h2", {}, "Baselines"), learning);
  const nodes = [head, versions.node, buttons, form.node, element("h2", {}, "What was done"), steps.node];
  return {
    node: element("section", { class: "panel alarm-list baselines" }, ...nodes),
    draw(found) {
      setText(learning, found.learning ? learningSentence(found) : "This film is not watched.");
      buttons.hidden = found.learning === null || !actor.may;
      freeze.hidden = found.is_frozen || found.in_force === null;
      thaw.hidden = !found.is_frozen;
      versions.draw(found.versions);
      steps.draw(found.steps);
    },
    fail: (words) => setText(learning, `Baselines cannot be read: ${words}`),
  };
}

function versionRow(version, path, form, mayChange) {
  const status = mark();
  status.draw(...(STATUS[version.status] ?? ["absent", version.status]));
  const frozen = version.is_frozen ? element("span", { class: "hold" }, "Frozen") : "";
  const node = element("tr", { role: "row", "data-version": String(version.version), "data-status": version.status });
  const accept = button("Accept…", () => form.open("accept", version.version, accept));
  const reject = button("Reject…", () => form.open("reject", version.version, reject));
  accept.hidden = !mayChange || version.status === "in_force";
  reject.hidden = !mayChange || version.status === "rejected";
  for (const [one, word] of [[accept, "Accept"], [reject, "Reject"]]) setAttribute(one, "aria-label", `${word} version ${version.version}…`);
  const href = `/api/v1/${[...path, "baselines", String(version.version), "export"].map(encodeURIComponent).join("/")}`;
  const save = element("a", { href, download: "" }, "Export");
  const contents = [
    String(version.version),
    element("span", {}, status.node, frozen),
    `${formatTime(Date.parse(version.learned_from))} to ${formatTime(Date.parse(version.learned_until))}`,
    `${formatTime(Date.parse(version.created))} by ${version.author}, ${estimatorWords(version.estimator)}`,
    [version.event, version.remark].filter(Boolean).join("; "),
    element("span", { class: "actions" }, accept, reject, save),
  ];
  node.append(...contents.map((content, index) => listingCell(HEADS[index], content)));
  return { nodes: [node], draw() {} };
}

function stepRow(step) {
  const event = step.event_time ? `, event ${formatTime(Date.parse(step.event_time))}` : "";
  const contents = [formatTime(Date.parse(step.time)), step.step + event, step.version === null ? "" : String(step.version), step.actor, step.reason];
  const cells = contents.map((content, index) => listingCell(STEP_HEADS[index], content));
  return { nodes: [element("tr", { role: "row", "data-step": step.step }, ...cells)], draw() {} };
}
