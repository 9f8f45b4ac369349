/** A choice of a few that stands in the address, so that a page can be bookmarked and sent. */

import { queryOf } from "../route.js";
import { choice } from "./choice.js";

/** As `choice`; `name` is its parameter behind the question mark, left out while it is as usual. */
export function keptChoice(name, legend, options, usual, onChange) {
  const asked = queryOf(location.hash).get(name);
  const [chosen] = options.find(([value]) => String(value) === asked) ?? [usual];
  const made = choice(legend, options, chosen, () => {
    keepInAddress(name, made.value() === usual ? null : made.value());
    onChange();
  });
  return made;
}

/** Set a parameter of the address or, with null, take it out; the page stays as it is. */
export function keepInAddress(name, value) {
  const [path] = location.hash.split("?");
  const query = queryOf(location.hash);
  if (value === null) query.delete(name);
  else query.set(name, String(value));
  history.replaceState(null, "", query.size ? `${path}?${query}` : path);
}
