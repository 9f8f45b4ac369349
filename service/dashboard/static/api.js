/** Questions to the padwatch service, with every way they can fail told apart. */

import { noteEdition } from "./edition.js";
import { noteTime } from "./server_time.js";

const TIMEOUT_MS = 8000;

/** An action may be carried out even if its answer is late, so that it is given up on later than a question. */
const ACTION_TIMEOUT_MS = 30_000;

/** The service does not answer at all; `why` is a sentence. */
export class NotReachable extends Error {
  constructor(why) {
    super(`Service not reachable. ${why}`);
  }
}

/** The service answered that it cannot give this; the message is a sentence for people. */
export class Refused extends Error {
  constructor(status, sentence, retryAfterS = null) {
    super(sentence);
    this.status = status;
    this.retryAfterS = retryAfterS;
  }
}

/** Answers by address with their entity tags, the one asked for longest ago first. */
const answers = new Map();
const N_ANSWERS = 32;

const REFUSED = "padwatch-refused";

/**
 * Fetch JSON from `/api/v1`; `path` is a list of segments, `query` a list of pairs.
 *
 * While nothing is new the service does not send the answer again, and the very same object is
 * returned.
 */
export async function ask(path, query = [], signal = undefined) {
  const search = new URLSearchParams(query).toString();
  const url = search ? `${urlOf(path)}?${search}` : urlOf(path);
  const known = answers.get(url);
  const headers = known ? { ...JSON_ONLY, "If-None-Match": known.tag } : JSON_ONLY;
  const response = await answer(url, signal, { headers });
  const body = known && response.status === 304 ? known.body : await given(response);
  keep(url, response.headers.get("ETag") ?? known?.tag, body);
  return body;
}

/** Readings of the film of a bearing, from `spanS` seconds before `endMs` until then. */
export function askReadings(path, endMs, spanS, maxPoints, signal) {
  const range = [["start", new Date(endMs - spanS * 1000).toISOString()], ["end", new Date(endMs).toISOString()]];
  return ask([...path, "film", "readings"], [...range, ["max_points", String(maxPoints)]], signal);
}

/** Ask `/api/v1` to do something; `body` is sent as JSON. Null where there is nothing to answer. */
export async function tell(path, body, method = "POST") {
  const headers = body === undefined ? JSON_ONLY : { ...JSON_ONLY, "Content-Type": "application/json" };
  const how = { method, headers, body: JSON.stringify(body) };
  const response = await answer(urlOf(path), undefined, how, ACTION_TIMEOUT_MS);
  return response.status === 204 ? null : given(response);
}

/** Call `look` whenever the service did not want to know us, or did not let us: perhaps a login is over. */
export const onRefused = (look) => window.addEventListener(REFUSED, look);

/** Drop every answer: the next user may be another one. */
export const forget = () => answers.clear();

const JSON_ONLY = { Accept: "application/json" };

const urlOf = (path) => `/api/v1/${path.map(encodeURIComponent).join("/")}`;

function keep(url, tag, body) {
  answers.delete(url);
  if (tag) answers.set(url, { tag, body });
  if (answers.size > N_ANSWERS) answers.delete(answers.keys().next().value);
}

async function given(response) {
  const body = await decoded(response);
  if (!response.ok) throw refusal(response, body);
  if (body === null) throw new NotReachable("The answer does not come from padwatch.");
  if (Array.isArray(body.time)) body.time = body.time.map((time) => Date.parse(time) / 1000); // for charts
  return body;
}

async function answer(url, signal, how, timeoutMs = TIMEOUT_MS) {
  const limit = AbortSignal.timeout(timeoutMs);
  const either = signal ? AbortSignal.any([signal, limit]) : limit;
  try {
    // no-store: the browser's own cache has no say, `answers` above has
    const response = await fetch(url, { ...how, signal: either, cache: "no-store" });
    noteEdition(response.headers);
    noteTime(response.headers);
    return response;
  } catch (failure) {
    if (signal?.aborted) throw failure;
    throw new NotReachable(limit.aborted ? `No answer within ${timeoutMs / 1000} s.` : "No connection.");
  }
}

async function decoded(response) {
  if (!response.headers.get("Content-Type")?.includes("json")) return null;
  try {
    return await response.json();
  } catch {
    throw new NotReachable("The answer broke off.");
  }
}

function refusal(response, body) {
  const { status } = response;
  if (status === 401 || status === 403) window.dispatchEvent(new Event(REFUSED));
  const words = body?.detail || body?.title || `The service answered with status ${status}`;
  const sentence = words.charAt(0).toUpperCase() + words.slice(1).replace(/\.?$/, ".");
  const seconds = Number.parseInt(response.headers.get("Retry-After"), 10);
  return new Refused(status, sentence, Number.isNaN(seconds) ? null : seconds);
}
