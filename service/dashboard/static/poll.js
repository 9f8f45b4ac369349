/** Asking again and again: one question at a time, at once after the tab becomes visible. */

/**
 * Run `task(signal)` now and then `periodS()` seconds after it finished, until stopped.
 *
 * The task deals with its own failures; what it throws beyond that is a bug and reaches the console.
 * Returns `{ again, stop }`: `again` drops a question under way and asks afresh at once.
 */
export function poll(task, periodS) {
  let question = new AbortController();
  let timer = null;

  async function ask() {
    clearTimeout(timer);
    question.abort();
    const mine = (question = new AbortController());
    try {
      await task(mine.signal);
    } catch (failure) {
      if (!mine.signal.aborted) console.error(failure);
    }
    if (!mine.signal.aborted) timer = setTimeout(ask, periodS() * 1000);
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
