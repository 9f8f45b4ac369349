/**
 * Every page: a new one is a file in `pages/` and a line here.
 *
 * `pattern` is its address, with open segments after a colon. `title` follows "padwatch: " in the
 * browser's tab; it is a text or is made from the segments. `nav` is its entry in the navigation,
 * in the order of this list; pages without stay reachable by links only. `open(main, ...segments)`
 * fills the empty `main` and returns `{ draw(view), close() }`. A page with a `permission` is for those
 * who have it.
 */

import { accessPage } from "./pages/access.js";
import { alarmsPage } from "./pages/alarms.js";
import { auditPage } from "./pages/audit.js";
import { bearingPage } from "./pages/bearing.js";
import { enterPage } from "./pages/enter.js";
import { explorerPage } from "./pages/explorer.js";
import { filmPage } from "./pages/film.js";
import { orbitsPage } from "./pages/orbits.js";
import { overviewPage } from "./pages/overview.js";
import { passwordPage } from "./pages/password.js";
import { recordingsPage } from "./pages/recordings.js";
import { sourcesPage } from "./pages/sources.js";
import { unitPage } from "./pages/unit.js";
import { unknownPage } from "./pages/no_page.js";
import { waterfallPage } from "./pages/waterfall.js";

export const PAGES = [
  { pattern: "#/", title: "overview", nav: "Plant", open: overviewPage },
  { pattern: "#/alarms", title: "alarms", nav: "Alarms", open: alarmsPage },
  { pattern: "#/trends", title: "trends", nav: "Trends", open: explorerPage },
  { pattern: "#/sources", title: "source health", nav: "Sources", open: sourcesPage },
  { pattern: "#/recordings", title: "recordings and reports", nav: "Recordings", open: recordingsPage },
  { pattern: "#/audit", title: "audit trail", nav: "Audit", permission: "read_audit", open: auditPage },
  { pattern: "#/access", title: "access", nav: "Access", permission: "change_access", open: accessPage },
  { pattern: "#/login", title: "log in", open: enterPage },
  { pattern: "#/password", title: "your password", open: passwordPage },
  { pattern: "#/units/:unit", title: (unit) => unit, open: unitPage },
  { pattern: "#/units/:unit/bearings/:bearing", title: (unit, bearing) => `${unit} ${bearing}`, open: bearingPage },
  { pattern: "#/units/:unit/bearings/:bearing/film", title: (unit, bearing) => `film of ${unit} ${bearing}`, open: filmPage },
  { pattern: "#/units/:unit/bearings/:bearing/waterfall", title: (unit, bearing) => `spectra over time of ${unit} ${bearing}`, open: waterfallPage },
  { pattern: "#/units/:unit/bearings/:bearing/orbits", title: (unit, bearing) => `orbits of ${unit} ${bearing}`, open: orbitsPage },
];

/** What an address leads to that none of the pages has. */
export const NO_PAGE = { title: "no such page", open: unknownPage };
