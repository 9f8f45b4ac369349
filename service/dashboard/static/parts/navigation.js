/** The way to every page, and how this browser shows them; behind a button where the screen is narrow. */

import { AMPLITUDES, amplitudes, chooseAmplitudes } from "../amplitudes.js";
import { button, element, setAttribute } from "../dom.js";
import { isLocked, may } from "../session.js";
import { THEMES, chooseTheme, theme } from "../theme.js";

/** Returns `{ button, node, show(page), close(), draw() }`; `show` marks where we are, `close` folds the menu up. */
export function navigation(pages) {
  const links = pages.filter((page) => page.nav).map((page) => [page, element("a", { href: page.pattern }, page.nav)]);
  const list = element("ul", {}, ...links.map(([, link]) => element("li", {}, link)));
  const look = select("Theme", THEMES, theme(), chooseTheme);
  const amplitude = select("Amplitudes", AMPLITUDES, amplitudes(), chooseAmplitudes);
  const settings = element("details", { class: "settings" }, element("summary", {}, "Settings"), look, amplitude);
  const node = element("div", { id: "menu", class: "menu" }, element("nav", { "aria-label": "Pages" }, list), settings);
  const isOpen = () => opener.getAttribute("aria-expanded") === "true";
  const opener = button("Menu", () => unfold(!isOpen()), { class: "menu-button", "aria-expanded": "false", "aria-controls": "menu" });
  const unfold = (open) => setAttribute(opener, "aria-expanded", String(open));
  node.addEventListener("keydown", (key) => {
    if (key.key !== "Escape" || !isOpen()) return;
    unfold(false);
    opener.focus();
  });
  return {
    button: opener,
    node,
    show(here) {
      for (const [page, link] of links) setAttribute(link, "aria-current", page === here ? "page" : null);
      amplitude.hidden = here === pages[0]; // the overview shows none
    },
    close: () => unfold(false),
    draw() {
      for (const [{ permission }, link] of links) {
        link.parentNode.hidden = isLocked() || (permission !== undefined && !may(permission));
      }
    },
  };
}

function select(label, options, chosen, choose) {
  const choices = options.map(([value, words]) => element("option", { value }, words));
  const control = element("select", {}, ...choices);
  control.value = chosen;
  control.addEventListener("change", () => choose(control.value));
  return element("label", { class: "setting" }, `${label} `, control);
}
