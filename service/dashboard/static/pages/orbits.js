/** The orbit player: a shaft's motion as it is now, or at any moment of a recording. */

import { reachOf, trailAt } from "../charts/orbit_clip.js";
import { orbitPicture } from "../charts/orbit_picture.js";
import { timebasePicture } from "../charts/timebase_picture.js";
import { waveforms } from "../charts/waveforms.js";
import { element, setText } from "../dom.js";
import { formatAge } from "../format.js";
import { keepInAddress } from "../parts/kept_choice.js";
import { STOPPED, advanced, moved } from "../parts/playhead.js";
import { poll } from "../poll.js";
import { orbitAddress, queryOf } from "../route.js";
import { onTheme } from "../theme.js";
import { bearingHead } from "./bearing_head.js";
import { orbitChoices } from "./orbit_choices.js";
import { orbitControls } from "./orbit_controls.js";
import { orbitFacts } from "./orbit_facts.js";
import { liveSource, recordedSource } from "./orbit_source.js";

const PERIOD_S = 2;

/** How far behind the newest sample live motion is played, so that it never has to wait for one, s. */
const LAG_S = 3.5;

/** Without new samples for so long, motion is no longer live, s. */
const STALE_S = 8;

/** Steps of the picture: thirty a second are smooth, and a tab that slept does not leap, s. */
const [SHORTEST_STEP_S, LONGEST_STEP_S] = [0.03, 0.25];

/** Returns `{ draw(view), close() }`. */
export function orbitsPage(main, unit, bearing) {
  const path = ["units", unit, "bearings", bearing];
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const head = bearingHead(unit, bearing, ": orbit player", orbitAddress);
  const asked = queryOf(location.hash).get("recording");
  const choices = orbitChoices(unit, asked, choose, paint);
  const controls = orbitControls({ play, step, seek, hasten, hold });
  const [orbit, timebase, facts] = [orbitPicture(), timebasePicture(), orbitFacts()];
  const sentence = element("p", { class: "sentence", role: "status" }, "Asking the service.");
  const pictures = element("div", { class: "orbit-pictures", hidden: "" }, orbit.node, timebase.node);
  const player = element("section", { class: "panel player", "aria-label": "Player" }, sentence, pictures, controls.node, facts.node);
  let absence = "Asking the service.";
  const waves = waveforms(unit, bearing, () => absence);
  main.append(element("div", { class: "bearing orbit-page" }, head.node, choices.node, player, waves.node));

  const sourceOf = (recording) => (recording === null ? liveSource(path) : recordedSource(recording, bearing));
  let source = sourceOf(asked);
  let clip = null;
  let at = { ...STOPPED, isPlaying: !isStill };
  let trouble = null;
  let reference = null;
  let shownMs = 0;
  let hasSamples = false;
  let staleness = null;

  const follows = () => source.isLive && at.isPlaying && at.speed === 1;
  function wants() {
    if (source.isLive) return hasSamples && (clip === null || follows());
    return clip === null || source.needs(clip, at.atS);
  }

  const questions = poll(async (signal) => {
    if (!wants()) return;
    const mine = source;
    const found = await mine.clip(at.atS, signal);
    if (mine === source) take(found);
  }, () => PERIOD_S, (failure) => {
    trouble = failure.message;
    paint();
  });

  /** A new piece is here: stay at the same moment, unless that is gone. */
  function take(found) {
    const isNew = clip === null || (source.isLive && clip.epoch !== found.epoch);
    [clip, trouble] = [{ ...found, reach: reachOf(found) }, null];
    const isGone = at.atS < clip.startS || at.atS > clip.endS;
    const isLate = isNew || isGone || at.atS < clip.endS - 2 * LAG_S;
    if (source.isLive && isLate) at = moved(at, clip.endS - LAG_S, clip);
    if (!source.isLive && at.atS < clip.startS) at = { ...at, atS: clip.startS }; // nothing is in between
    paint();
  }

  function choose(recording) {
    source = sourceOf(recording);
    keepInAddress("recording", recording);
    [clip, trouble] = [null, null];
    at = { ...at, atS: 0, isPlaying: !isStill };
    setText(sentence, "Asking the service.");
    questions.again();
    paint();
  }
  function play(isPlaying = !at.isPlaying) {
    const isOver = clip !== null && !source.isLive && at.atS >= clip.total_s - 0.05;
    at = { ...at, isPlaying, atS: isPlaying && isOver ? 0 : at.atS };
    questions.again();
    paint();
  }
  function step(turns) {
    if (clip === null) return;
    at = { ...at, isPlaying: false };
    seek(at.atS + turns * (clip.turnS ?? 1));
  }
  function seek(toS) {
    if (clip === null) return;
    at = moved(at, toS, source.isLive ? clip : { startS: 0, endS: clip.total_s });
    if (wants()) questions.again();
    paint();
  }
  function hasten(speed) {
    at = { ...at, speed };
    if (follows()) questions.again();
    paint();
  }

  /** Keep the newest turn to compare others with, or let go of the one that is kept. */
  function hold() {
    reference = reference === null && clip !== null ? { clip, ...trailAt(clip, at.atS, 1) } : null;
    paint();
  }

  function frame(nowMs) {
    timer = requestAnimationFrame(frame);
    const elapsedS = Math.min((nowMs - shownMs) / 1000, LONGEST_STEP_S);
    if (elapsedS < SHORTEST_STEP_S) return;
    shownMs = nowMs;
    if (!at.isPlaying || clip === null) return;
    at = advanced(at, elapsedS, clip, source.isLive && !follows());
    if (!source.isLive && at.atS >= clip.total_s - 0.02) at = { ...at, isPlaying: false };
    paint();
  }

  function paint() {
    const isThere = clip !== null && at.atS >= clip.startS - 1e-6 && at.atS <= clip.endS + 1e-6;
    const words = trouble ?? (isThere ? source.isLive && staleness : waitingWords(clip, source, absence));
    sentence.hidden = !words;
    if (words) setText(sentence, words);
    pictures.hidden = clip === null;
    controls.draw(at, clip, source, reference);
    facts.draw(isThere ? clip : null, at, source, { ...choices.how(), reference });
    if (!isThere) return;
    for (const picture of [orbit, timebase]) picture.draw(clip, at.atS, { ...choices.how(), reference });
  }

  const onResize = () => paint();
  const stopTheme = onTheme(paint);
  window.addEventListener("resize", onResize);
  let timer = requestAnimationFrame(frame);
  return {
    draw(view) {
      head.draw(view);
      const had = hasSamples;
      absence = absenceWords(view, unit, bearing);
      hasSamples = absence === null;
      staleness = stalenessWords(view, unit);
      if (hasSamples && !had) for (const asked of [questions, waves]) asked.again();
      if (!at.isPlaying || clip === null || staleness !== null) paint();
    },
    close() {
      cancelAnimationFrame(timer);
      questions.stop();
      waves.close();
      controls.close();
      stopTheme();
      window.removeEventListener("resize", onResize);
    },
  };
}

/** Why there is nothing live to play; null if there is. */
function absenceWords(view, unitId, bearingId) {
  if (view.silenceS === null) return "Asking the service.";
  const unit = view.units.find(({ id }) => id === unitId);
  if (!unit?.bearings.some(({ bearing }) => bearing === bearingId)) return `This plant has no bearing ${bearingId} on a unit ${unitId}.`;
  if (unit.source.received === undefined) return "Asking the service.";
  return unit.source.received === null ? "No sample of this unit has arrived since the service started." : null;
}

/** Note that no new samples arrive, so that the last motion is not taken for the present one; null if they arrive. */
function stalenessWords(view, unitId) {
  const ageS = view.units.find(({ id }) => id === unitId)?.source.data_age_s ?? null;
  if (ageS === null || ageS < STALE_S) return null;
  return `No new samples for ${formatAge(ageS)}: this is the last that came, not the present.`;
}

function waitingWords(clip, source, absence) {
  if (clip === null && source.isLive && absence !== null) return absence;
  if (clip === null) return "Asking the service.";
  if (source.isLive) return "Waiting for newer samples.";
  return "Fetching this part of the recording; where samples are missing there is nothing to play.";
}
