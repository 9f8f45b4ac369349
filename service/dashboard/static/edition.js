/** Whether the service has been upgraded since this page was loaded. */

const HEADER = "Padwatch-Edition";
const CHANGED = "padwatch-edition";

let mine = null;
let isOld = false;

/** Read the edition in the headers of an answer; one that differs from the first makes this page outdated. */
export function noteEdition(headers) {
  const edition = headers.get(HEADER);
  if (edition === null) return;
  mine ??= edition;
  if (isOld || edition === mine) return;
  isOld = true;
  window.dispatchEvent(new Event(CHANGED));
}

/** Call `tell` once, when the service has another edition than this page. */
export const onUpgrade = (tell) => window.addEventListener(CHANGED, tell, { once: true });
