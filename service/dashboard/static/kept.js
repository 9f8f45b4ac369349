/** What this browser remembers between visits; one that keeps nothing starts afresh each time. */

/** The remembered word, if it is one of `allowed`, else the first of them. */
export function kept(key, allowed) {
  const found = read(key);
  return allowed.includes(found) ? found : allowed[0];
}

/** Remember a word, for ever or, in `sessionStorage`, until the page is left. */
export function keep(key, word, storage = "localStorage") {
  try {
    window[storage].setItem(key, word);
  } catch {
    // it is asked for again next time
  }
}

/** The remembered word; null without one. */
export function read(key, storage = "localStorage") {
  try {
    return window[storage].getItem(key);
  } catch {
    return null;
  }
}
