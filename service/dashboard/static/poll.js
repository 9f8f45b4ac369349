/** Asking again and again: one question at a time, at once after the tab becomes visible. */

import { NotReachable } from "./api.js";

const [SHORTEST_S, LONGEST_S, RETRY_S] = [5, 60, 1];

/** Period of a question about results gathered over some seconds each: a year does not change within five seconds. */
export const periodFor = (bucketS) => Math.min(Math.max(bucketS, SHORTEST_S), LONGEST_S);

/**
 * Run `task(signal)` now and then `periodS()` seconds after it finished, sooner if the service was not reachable, until stopped.
 *
 * `fail(failure)` receives what the task throws, unless its question was dropped.
 * Returns `{ again, stop }`: `again` drops a question under way and asks afresh at once.
 */
export function poll(task, periodS, fail = console.error) {
  let question = new AbortController();
  let timer = null;

  async function ask() {
    clearTimeout(timer);
    question.abort();
    const mine = (question = new AbortController());
    let longestS = Infinity;
    try {
      await task(mine.signal);
    } catch (failure) {
      if (failure instanceof NotReachable) longestS = RETRY_S;
      if (!mine.signal.aborted) fail(failure);
    } finally {
      if (!mine.signal.aborted) timer = setTimeout(ask, Math.min(periodS(), longestS) * 1000);
    }
  }

  const onVisible = () => document.visibilityState === "visible" && ask();
  document.addEventListener("visibilitychange", onVisible);
  ask();
  return {
    again: ask,
    stop() {
      clearTimeout(timer);
      question.abort();
      document.removeEventListener("visibilitychange", onVisible);
    },
  };
}
