/** Names of quantities in words, asked for once. */

import { ask } from "./api.js";

let labels = null;

/** Ask for the catalogue of quantities, unless it is known. */
export async function loadCatalogue(signal) {
  labels ??= new Map((await ask(["quantities"], [], signal)).map(({ name, label }) => [name, label]));
}

/** A quantity in words. */
export const labelOf = (name) => labels?.get(name) ?? name;
