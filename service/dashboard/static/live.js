/** What the service said last, how long ago, and what of it may still be shown. */

/** Numbers older than this many seconds in the browser are not shown any more. */
export const CURRENT_LIMIT_S = 10;

const NOT_REACHABLE = { level: "bad", reason: "service_not_reachable" };

/** What a bearing is without a current answer, beside its readings. */
const NOTHING_KNOWN = { quality: NOT_REACHABLE, speed_source: null, estimators: { xx: null, yy: null } };

/** State before the first answer. `receivedAt`: time of the last answer; `dated`: when its content first arrived. */
export const SILENCE = { overview: null, receivedAt: null, dated: null, failure: null, failedSince: null };

/** Two clocks, since a steady one may stand still while a laptop sleeps. */
export function moment() {
  return { steadyMs: performance.now(), wallMs: Date.now() };
}

/** Seconds between two moments, the larger of both clocks: rather too old than too young. */
export function secondsBetween(earlier, later) {
  return Math.max(later.steadyMs - earlier.steadyMs, later.wallMs - earlier.wallMs, 0) / 1000;
}

/** The state after a good answer; one that is the same as before keeps its date, so that ages go on. */
export function heardNow(live, overview, now) {
  const dated = overview === live.overview ? live.dated : now;
  return { overview, receivedAt: now, dated, failure: null, failedSince: null };
}

/** The state after a question that failed; the last answer stays, and ages. */
export function failedNow(live, sentence, now) {
  return { ...live, failure: sentence, failedSince: live.failedSince ?? now };
}

/** What to show at this moment: ages counted on, and no number that is no longer current. */
export function viewAt(live, now) {
  const silenceS = live.receivedAt ? secondsBetween(live.receivedAt, now) : null;
  const current = silenceS !== null && silenceS <= CURRENT_LIMIT_S;
  const sinceS = live.dated ? secondsBetween(live.dated, now) : null;
  return {
    current,
    silenceS,
    failure: live.failure,
    failedS: live.failedSince ? secondsBetween(live.failedSince, now) : null,
    plant: live.overview?.plant.name ?? null,
    origin: live.overview?.plant.origin ?? null,
    storeError: live.overview?.store.error ?? null,
    captureError: live.overview?.captures.error ?? null,
    alarms: current ? live.overview.alarms : null,
    refreshS: live.overview?.refresh_s ?? null,
    serviceTimeMs: live.overview ? Date.parse(live.overview.time) + sinceS * 1000 : null,
    units: (live.overview?.units ?? []).map((unit) => agedUnit(unit, sinceS, current)),
  };
}

function agedUnit(unit, sinceS, current) {
  const source = { ...unit.source, data_age_s: aged(unit.source.data_age_s, sinceS) };
  return {
    ...unit,
    source: current ? source : { ...source, state: "unknown", reason: null, since: null },
    bearings: unit.bearings.map((latest) => agedLatest(latest, sinceS, current)),
    films: current ? unit.films : unit.films.map(withheldFilm),
  };
}

function agedLatest(latest, sinceS, current) {
  const shown = { ...latest, age_s: aged(latest.age_s, sinceS) };
  return current ? shown : { ...shown, ...NOTHING_KNOWN, readings: withheld(latest.readings) };
}

const UNREAD = { verdict: "no_reading", change_percent: null };

function withheldFilm(film) {
  return film.why_not === null ? { ...film, x: { ...film.x, ...UNREAD }, y: { ...film.y, ...UNREAD } } : film;
}

function withheld(readings) {
  return Object.fromEntries(
    Object.entries(readings).map(([name, reading]) => [name, { ...reading, value: null, uncertainty: null, ...NOT_REACHABLE }]),
  );
}

function aged(ageS, sinceS) {
  return ageS === null ? null : ageS + sinceS;
}
