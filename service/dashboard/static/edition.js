/** Whether the service has been upgraded since this page was loaded. */

const HEADER = "Padwatch-Edition";
const CHANGED = "padwatch-edition";

let mine = null;
let isOld = false;

/** Look at the headers of an answer: the first tells what we are, a different one that we are old. */
export function noteEdition(headers) {
  const edition = headers.get(HEADER);
  if (edition === null) return;
  mine ??= edition;
  if (isOld || edition === mine) return;
  isOld = true;
  window.dispatchEvent(new Event(CHANGED));
}

/** Call `tell` once, when the service has become another one than this page was made for. */
export const onUpgrade = (tell) => window.addEventListener(CHANGED, tell, { once: true });
