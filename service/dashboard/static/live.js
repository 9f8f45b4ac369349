/** What the service said last, how long ago, and what of it may still be shown. */

/** Numbers older than this many seconds in the browser are not shown any more. */
export const CURRENT_LIMIT_S = 10;

const NOT_REACHABLE = { level: "bad", reason: "service_not_reachable" };

/** What a bearing is without a current answer, beside its readings. */
const NOTHING_KNOWN = { quality: NOT_REACHABLE, speed_source: null, estimators: { xx: null, yy: null } };

/** State before the first answer. `receivedAt`: time of the last answer; `details`: see `detailsOf` in `app.js`. */
export const SILENCE = { overview: null, details: null, receivedAt: null, failure: null, failedSince: null };

/** Two clocks, since a steady one may stand still while a laptop sleeps. */
export function moment() {
  return { steadyMs: performance.now(), wallMs: Date.now() };
}

/** Seconds between two moments, the larger of both clocks: rather too old than too young. */
export function secondsBetween(earlier, later) {
  return Math.max(later.steadyMs - earlier.steadyMs, later.wallMs - earlier.wallMs, 0) / 1000;
}

/** The overview after an answer that holds all units, or only those that changed since the one before. */
export function merged(overview, news) {
  if (overview === null || news.since === null) return news;
  const changed = new Map(news.units.map((unit) => [unit.id, unit]));
  return { ...news, units: overview.units.map((unit) => changed.get(unit.id) ?? unit) };
}

/** The state after good answers. */
export function heardNow(overview, details, now) {
  return { overview, details, receivedAt: now, failure: null, failedSince: null };
}

/** The state after a question that failed; the last answer stays, and ages. */
export function failedNow(live, sentence, now) {
  return { ...live, failure: sentence, failedSince: live.failedSince ?? now };
}

/** Seconds from a time in an answer to the present time of the service; null without that time. */
export const ageAt = (time, timeMs) => (time && timeMs !== null ? Math.max(timeMs - Date.parse(time), 0) / 1000 : null);

/** A second after the newest result of a replay, which has the time of the recording; null without a result. */
function replayTimeMs({ units }) {
  const times = units.flatMap(({ bearings }) => bearings.map(({ time }) => Date.parse(time ?? ""))).filter((ms) => !Number.isNaN(ms));
  return times.length ? Math.max(...times) + 1000 : null;
}

/**
 * What to show at this moment: ages at the time `timeMs` of the service, and no number that is no longer current.
 *
 * `serviceTimeMs`, where histories end, is that time, but in a replay that of its newest result.
 */
export function viewAt(live, now, timeMs) {
  const silenceS = live.receivedAt ? secondsBetween(live.receivedAt, now) : null;
  const current = silenceS !== null && silenceS <= CURRENT_LIMIT_S;
  return {
    current,
    silenceS,
    failure: live.failure,
    failedS: live.failedSince ? secondsBetween(live.failedSince, now) : null,
    plant: live.overview?.plant ?? null,
    origin: live.overview?.origin ?? null,
    storeError: live.overview?.store_error ?? null,
    captureError: live.overview?.captures_error ?? null,
    alarms: current ? live.overview.alarms : null,
    refreshS: live.overview?.refresh_s ?? null,
    serviceTimeMs: live.overview?.origin === "replay" ? replayTimeMs(live.overview) : live.overview && timeMs,
    units: (live.overview?.units ?? []).map((unit) => agedUnit(unit, live.details, timeMs, current)),
  };
}

/** A unit with what is known of it beyond its tile: `isWhole` of a bearing says whether it has all its readings. */
function agedUnit(unit, details, timeMs, current) {
  const told = { ...unit.source, ...details?.sources.get(unit.id) };
  const source = { ...told, data_age_s: ageAt(told.received, timeMs) };
  return {
    ...unit,
    operating_state: current ? unit.operating_state : null,
    source: current ? source : { ...source, state: "unknown", reason: null, since: null },
    bearings: unit.bearings.map((tile) => agedLatest(tile, details?.latest.get(`${unit.id}/${tile.bearing}`), timeMs, current)),
    films: unit.bearings.map(({ film }) => (current ? film : withheldFilm(film))),
  };
}

function agedLatest(tile, latest, timeMs, current) {
  const told = { ...tile, ...latest, isWhole: latest !== undefined };
  const shown = { ...told, age_s: ageAt(told.received, timeMs) };
  return current ? shown : { ...shown, ...NOTHING_KNOWN, bad_reasons: [], doubtful_signs: [], readings: withheld(told.readings) };
}

const UNREAD = { verdict: "no_reading", change_percent: null, deviation_percent: null, stiffness_n_per_m: null, expected_n_per_m: null, stiffness_of_kb: null, expected_of_kb: null };

function withheldFilm(film) {
  return film.why_not === null ? { ...film, x: { ...film.x, ...UNREAD }, y: { ...film.y, ...UNREAD } } : film;
}

function withheld(readings) {
  return Object.fromEntries(
    Object.entries(readings).map(([name, reading]) => [name, { ...reading, value: null, uncertainty: null, ...NOT_REACHABLE }]),
  );
}
