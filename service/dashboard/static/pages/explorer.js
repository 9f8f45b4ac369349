/** The trend explorer: any quantities of any bearings over any time, side by side. */

import { ask } from "../api.js";
import { askBeside } from "../charts/beside.js";
import { element, setText } from "../dom.js";
import { stateWords } from "../film_words.js";
import { choice } from "../parts/choice.js";
import { picker } from "../parts/picker.js";
import { periodFor, poll } from "../poll.js";
import { grouped } from "../quantity_groups.js";
import { explorerCharts } from "./explorer_charts.js";
import { explorerFiles } from "./explorer_files.js";
import { explorerNotes } from "./explorer_notes.js";
import { FORMS, MOST_BEARINGS, MOST_QUANTITIES, STATES, addressOf, isOverTime, rangeOf, stateOf } from "./explorer_state.js";
import { timeBar } from "./explorer_time.js";

const MAX_POINTS = 800;
const LEAST_ZOOM = 0.002;

/** Returns `{ draw(view), close() }`. */
export function explorerPage(main) {
  const isBare = !location.hash.includes("?");
  let state = stateOf(location.hash);
  let view = null;
  let catalogue = null;
  let bucketS = 0;
  let nUnits = 0;

  const quantities = picker("Quantities", MOST_QUANTITIES, (names) => change({ quantities: names }));
  const bearings = picker("Bearings", MOST_BEARINGS, (ids) => change({ bearings: ids.map((id) => id.split("/")) }));
  const form = choice("Over", FORMS, state.form, () => change({ form: form.value() }));
  const states = stateSelect(state.state, (name) => change({ state: name }));
  const time = timeBar(go, back);
  const charts = explorerCharts(zoom, back);
  const files = explorerFiles();
  const notes = explorerNotes(() => questions.again());
  const note = element("p", { class: "sentence", role: "status", hidden: "" });
  const pickers = element("div", { class: "explorer-pickers" }, bearings.node, quantities.node);
  const looks = element("div", { class: "choices" }, form.node, states, hint());
  main.append(element("div", { class: "explorer" }, element("h1", {}, "Trends"), pickers, time.node, looks, note, charts.node, notes.node, files.node));

  charts.explain("Asking the service.");

  const nowMs = () => view?.serviceTimeMs ?? Date.now();
  const depth = () => history.state?.depth ?? 0;

  function change(changes) {
    state = { ...state, ...changes };
    history.replaceState(history.state, "", addressOf(state));
    show();
  }

  /** Another time; the one before is a step back in the browser's history. */
  function go(changes) {
    state = { ...state, ...changes };
    history.pushState({ depth: depth() + 1 }, "", addressOf(state));
    show();
  }

  function zoom(fromMs, toMs) {
    const [startMs, endMs] = rangeOf(state, nowMs());
    const isSame = Math.abs(fromMs - startMs) + Math.abs(toMs - endMs) < LEAST_ZOOM * (endMs - startMs);
    if (!isSame && fromMs < toMs) go({ spanS: null, fromMs: Math.round(fromMs), toMs: Math.round(toMs) });
  }

  function back() {
    if (depth() > 0) history.back(); // the address changes, and the page opens anew from it
  }

  function show() {
    time.show(state, nowMs(), depth() > 0);
    quantities.choose(state.quantities);
    bearings.choose(state.bearings.map((one) => one.join("/")));
    questions.again();
  }

  const questions = poll(async (signal) => {
    if (view?.serviceTimeMs == null) return;
    catalogue ??= await offered(signal);
    await showTrends(signal);
  }, () => periodFor(state.spanS === null ? Infinity : bucketS), charts.trouble);

  async function offered(signal) {
    const found = await ask(["quantities"], [], signal);
    quantities.offer(grouped(found));
    return new Map(found.map(({ name, label }) => [name, label]));
  }

  async function showTrends(signal) {
    const known = { ...state, quantities: state.quantities.filter((name) => catalogue.has(name)) };
    const unknown = state.quantities.filter((name) => !catalogue.has(name));
    const range = rangeOf(state, nowMs());
    const asked = state.bearings.map((bearing) => ({ bearing, query: queryFor(known, range) }));
    const complaints = unknown.map((name) => `This padwatch knows no quantity ${name}.`);
    files.show(known.quantities.length ? asked : []);
    const found = [];
    if (known.quantities.length && asked.length) {
      const answers = await Promise.allSettled(asked.map(({ bearing, query }) => Promise.all([ask(pathOf(bearing), query, signal), askBeside(bearing, known.quantities, range, signal)])));
      signal.throwIfAborted();
      answers.forEach(({ value, reason }, n) => {
        if (value) found.push({ bearing: asked[n].bearing, trends: value[0], beside: value[1] });
        else complaints.push(`${asked[n].bearing.join(" ")}: ${reason.message}`);
      });
      if (found.length === 0) throw answers[0].reason;
    }
    say(complaints);
    notes.show(found, range);
    bucketS = found[0]?.trends.bucket_s ?? 0;
    if (found.length) await charts.show(found, known, catalogue, view.refreshS);
    else charts.explain(known.quantities.length ? "Choose at least one bearing." : "Choose at least one quantity.");
  }

  function say(complaints) {
    setText(note, complaints.join(" "));
    note.hidden = complaints.length === 0;
  }

  return {
    draw(now) {
      const first = view?.serviceTimeMs == null && now.serviceTimeMs !== null;
      view = now;
      time.tick(nowMs());
      if (now.units.length && now.units.length !== nUnits) offerBearings(now.units);
      if (first) show();
      const isOver = now.origin === "replay" && now.units.every(({ source }) => source.state === "ended");
      if (first && isBare && isOver) recordedRange(state.bearings[0], nowMs()).then(change, (failure) => charts.trouble(failure));
      charts.draw(now.current || now.silenceS === null ? null : "the service does not answer.");
    },
    close: questions.stop,
  };

  function offerBearings(units) {
    nUnits = units.length;
    bearings.offer(units.map((unit) => [unit.name, unit.bearings.map(({ bearing }) => [`${unit.id}/${bearing}`, `${unit.id} ${bearing}`])]));
    if (state.bearings.length === 0 && isBare) change({ bearings: [worstBearing(units)] });
  }
}

/** The bearing with the worst alarm of its film, else the first. */
function worstBearing(units) {
  const all = units.flatMap((unit) => unit.bearings.map(({ bearing }, n) => [unit.id, bearing, unit.films[n]]));
  const hasLevel = (level) => ([, , film]) => [film.x?.level, film.y?.level].includes(level);
  return (all.find(hasLevel("danger")) ?? all.find(hasLevel("alert")) ?? all[0]).slice(0, 2);
}

/** From the first to the last result of a replay: asked for twice, since buckets of a long time are wide. */
async function recordedRange(bearing, toMs) {
  let fromMs = 0;
  for (let n = 0; n < 2; n += 1) {
    const range = queryFor({ quantities: ["speed_rpm"], form: "" }, [fromMs, toMs]);
    const { time } = await ask(pathOf(bearing), range);
    fromMs = (time[0] ?? 0) * 1000;
  }
  return { spanS: null, fromMs, toMs };
}

const pathOf = ([unit, bearing]) => ["units", unit, "bearings", bearing, "trends"];

function queryFor(state, range) {
  const conditions = isOverTime(state) ? [] : [state.form];
  const query = [...new Set([...state.quantities, ...conditions])].map((name) => ["quantity", name]);
  const [start, end] = range.map((ms) => new Date(ms).toISOString());
  query.push(["start", start], ["end", end], ["max_points", String(MAX_POINTS)]);
  return state.state ? [...query, ["state", state.state]] : query;
}

function stateSelect(chosen, onChange) {
  const options = STATES.map((value) => element("option", { value }, stateWords(value)));
  const select = element("select", {}, element("option", { value: "" }, "all operating states"), ...options);
  select.value = chosen;
  select.addEventListener("change", () => onChange(select.value));
  return element("label", { class: "setting" }, "While at ", select);
}

const hint = () => element("span", { class: "hint" }, "Drag in a chart to zoom in, double-click to go back.");
