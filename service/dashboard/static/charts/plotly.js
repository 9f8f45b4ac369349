/** The chart library, loaded when the first chart needs it and tried again if that failed. */

import { LIBRARIES } from "../libraries.js";

let library = null;

/** Resolves to Plotly; rejects when its file cannot be had now. */
export function plotly() {
  library ??= loaded().catch((failure) => {
    library = null;
    throw failure;
  });
  return library;
}

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
