/** Addresses within the page: `#/`, `#/alarms` and `#/units/U1/bearings/UJB`. */

export const ALARMS_ADDRESS = "#/alarms";

/** Address of a bearing's page. */
export function bearingAddress(unit, bearing) {
  return `#/units/${encodeURIComponent(unit)}/bearings/${encodeURIComponent(bearing)}`;
}

/** The unit and bearing an address names, or null for the overview. */
export function routeOf(hash) {
  const [, unit, bearing] = /^#\/units\/([^/]+)\/bearings\/([^/]+)$/.exec(hash) ?? [];
  return bearing ? { unit: decoded(unit), bearing: decoded(bearing) } : null;
}

function decoded(segment) {
  try {
    return decodeURIComponent(segment);
  } catch {
    return segment; // a stray % was typed: the page will say that no such bearing exists
  }
}
