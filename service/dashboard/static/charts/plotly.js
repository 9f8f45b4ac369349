/** The chart library, loaded when the first chart needs it, after the numbers, and tried again if that failed. */

import { LIBRARIES } from "../libraries.js";

let library = null;

/** Resolves to Plotly; rejects when its file cannot be had now. */
export function plotly() {
  library ??= painted().then(loaded).catch((failure) => {
    library = null;
    throw failure;
  });
  return library;
}

/** Resolves once the page as it is now has been painted: running the library takes half a second. */
const painted = () => new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));

function loaded() {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = LIBRARIES["plotly.min.js"];
    script.onload = () => resolve(globalThis.Plotly);
    script.onerror = () => {
      script.remove();
      reject(new Error("The chart library could not be loaded; trying again."));
    };
    document.head.append(script);
  });
}
