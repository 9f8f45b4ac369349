/** What this browser remembers between visits; one that keeps nothing starts afresh each time. */

/** The remembered word, if it is one of `allowed`, else the first of them. */
export function kept(key, allowed) {
  const found = read(key);
  return allowed.includes(found) ? found : allowed[0];
}

/** Remember a word. */
export function keep(key, word) {
  try {
    localStorage.setItem(key, word);
  } catch {
    // it is asked for again next time
  }
}

function read(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}
