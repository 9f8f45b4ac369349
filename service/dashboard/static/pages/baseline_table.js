/** Versions of a bearing's baseline: where each comes from, where it stands, and what may be done. */

import { element, setAttribute, setText } from "../dom.js";
import { learningSentence } from "../film_words.js";
import { formatTime } from "../format.js";
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
  const versions = table("Baselines", HEADS);
  const steps = table("What was done", STEP_HEADS);
  const head = element("div", { class: "baselines-head" }, element("h2", {}, "Baselines"), learning);
  const nodes = [head, versions.node, buttons, form.node, element("h2", {}, "What was done"), steps.node];
  let drawn = "";
  return {
    node: element("section", { class: "panel alarm-list baselines" }, ...nodes),
    draw(found) {
      setText(learning, found.learning ? learningSentence(found) : "This film is not watched.");
      buttons.hidden = found.learning === null || !actor.may;
      freeze.hidden = found.is_frozen || found.in_force === null;
      thaw.hidden = !found.is_frozen;
      const now = JSON.stringify([found.versions, found.steps]);
      if (now === drawn) return;
      drawn = now;
      versions.fill(found.versions.map((version) => versionRow(version, path, form, actor.may)));
      steps.fill(found.steps.map(stepRow));
    },
    fail(words) {
      setText(learning, `Baselines cannot be read: ${words}`);
    },
  };
}

function table(title, heads) {
  const body = element("tbody", { role: "rowgroup" });
  const cells = heads.map((head) => element("th", { scope: "col", role: "columnheader" }, head || element("span", { class: "hidden" }, "Actions")));
  const whole = element("table", { role: "table", "aria-label": title, hidden: "" }, element("thead", { role: "rowgroup" }, element("tr", { role: "row" }, ...cells)), body);
  const none = element("p", { class: "sentence" }, "None yet.");
  return {
    node: element("div", {}, none, whole),
    fill(rows) {
      whole.hidden = rows.length === 0;
      none.hidden = rows.length > 0;
      body.replaceChildren(...rows);
    },
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
  node.append(...contents.map((content, index) => cell(HEADS[index], content)));
  return node;
}

function stepRow(step) {
  const event = step.event_time ? `, event ${formatTime(Date.parse(step.event_time))}` : "";
  const contents = [formatTime(Date.parse(step.time)), step.step + event, step.version === null ? "" : String(step.version), step.actor, step.reason];
  return element("tr", { role: "row", "data-step": step.step }, ...contents.map((content, index) => cell(STEP_HEADS[index], content)));
}

const cell = (head, content) => element("td", { role: "cell", "data-head": head }, content);

function button(words, onClick) {
  const node = element("button", { type: "button" }, words);
  node.addEventListener("click", onClick);
  return node;
}
