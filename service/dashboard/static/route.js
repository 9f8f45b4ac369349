/** Addresses within the page: `#/`, `#/alarms`, `#/units/U1/bearings/UJB` and `…/UJB/film`. */

export const ALARMS_ADDRESS = "#/alarms";

/** Address of a bearing's page. */
export function bearingAddress(unit, bearing) {
  return `#/units/${encodeURIComponent(unit)}/bearings/${encodeURIComponent(bearing)}`;
}

/** Address of the page of a bearing's film. */
export function filmAddress(unit, bearing) {
  return `${bearingAddress(unit, bearing)}/film`;
}

/** The unit and bearing an address names, and whether it is about the film; null for the overview. */
export function routeOf(hash) {
  const [, unit, bearing, film] = /^#\/units\/([^/]+)\/bearings\/([^/]+)(\/film)?$/.exec(hash) ?? [];
  return bearing ? { unit: decoded(unit), bearing: decoded(bearing), isFilm: film !== undefined } : null;
}

function decoded(segment) {
  try {
    return decodeURIComponent(segment);
  } catch {
    return segment; // a stray % was typed: the page will say that no such bearing exists
  }
}
