/** Questions to the padwatch service, with every way they can fail told apart. */

const TIMEOUT_MS = 8000;

/** The service does not answer at all. */
export class NotReachable extends Error {}

/** The service answered that it cannot give this; the message is a sentence for people. */
export class Refused extends Error {
  constructor(status, sentence) {
    super(sentence);
    this.status = status;
  }
}

/** Fetch JSON from `/api/v1`; `path` is a list of segments, `query` a list of pairs. */
export async function ask(path, query = [], signal = undefined) {
  const search = new URLSearchParams(query).toString();
  return given(await answer(search ? `${urlOf(path)}?${search}` : urlOf(path), signal));
}

/** Ask `/api/v1` to do something; `body` is sent as JSON. */
export async function tell(path, body) {
  const headers = { Accept: "application/json", "Content-Type": "application/json" };
  return given(await answer(urlOf(path), undefined, { method: "POST", headers, body: JSON.stringify(body) }));
}

const urlOf = (path) => `/api/v1/${path.map(encodeURIComponent).join("/")}`;

async function given(response) {
  const body = await decoded(response);
  if (!response.ok) throw new Refused(response.status, sentenceOf(response, body));
  if (body === null) throw new NotReachable("The answer does not come from padwatch.");
  return body;
}

async function answer(url, signal, how = { headers: { Accept: "application/json" } }) {
  const limit = AbortSignal.timeout(TIMEOUT_MS);
  const either = signal ? AbortSignal.any([signal, limit]) : limit;
  try {
    return await fetch(url, { ...how, signal: either, cache: "no-store" });
  } catch (failure) {
    if (signal?.aborted) throw failure;
    throw new NotReachable(limit.aborted ? `No answer within ${TIMEOUT_MS / 1000} s.` : "No connection.");
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

function sentenceOf(response, body) {
  const words = body?.detail || body?.title || `The service answered with status ${response.status}`;
  return words.charAt(0).toUpperCase() + words.slice(1).replace(/\.?$/, ".");
}
