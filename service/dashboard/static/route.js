/** Addresses within the page: `#/`, `#/alarms`, `#/units/U1/bearings/UJB`, `#/trends?span=3600`. */

export const ALARMS_ADDRESS = "#/alarms";
export const SOURCES_ADDRESS = "#/sources";
export const RECORDINGS_ADDRESS = "#/recordings";

/** Address of a unit's page. */
export function unitAddress(unit) {
  return `#/units/${encodeURIComponent(unit)}`;
}

/** Address of a bearing's page. */
export function bearingAddress(unit, bearing) {
  return `#/units/${encodeURIComponent(unit)}/bearings/${encodeURIComponent(bearing)}`;
}

/** Address of the spectra of a bearing over time. */
export function waterfallAddress(unit, bearing) {
  return `${bearingAddress(unit, bearing)}/waterfall`;
}

/** Address of the player of a bearing’s orbits: live, or of a recording. */
export function orbitAddress(unit, bearing, recording = null) {
  const query = recording === null ? "" : `?${new URLSearchParams({ recording })}`;
  return `${bearingAddress(unit, bearing)}/orbits${query}`;
}

/** Address of the page of a bearing's film. */
export function filmAddress(unit, bearing) {
  return `${bearingAddress(unit, bearing)}/film`;
}

/**
 * The first of some pages whose pattern an address fits, with the segments that the pattern leaves open.
 *
 * A pattern such as `#/units/:unit/bearings/:bearing` names open segments after a colon. What follows
 * a question mark belongs to the page. Null if no page has such an address.
 */
export function routeOf(hash, pages) {
  const parts = segmentsOf(hash || "#/");
  for (const page of pages) {
    const segments = openSegments(segmentsOf(page.pattern), parts);
    if (segments) return { page, segments };
  }
  return null;
}

/** What a page keeps in its address behind the question mark. */
export function queryOf(hash) {
  return new URLSearchParams(hash.split("?")[1] ?? "");
}

const segmentsOf = (address) => address.split("?")[0].replace(/\/$/, "").split("/").slice(1);

function openSegments(pattern, parts) {
  if (pattern.length !== parts.length) return null;
  if (!pattern.every((segment, n) => (segment.startsWith(":") ? parts[n] !== "" : segment === parts[n]))) return null;
  return parts.filter((_, n) => pattern[n].startsWith(":")).map(decoded);
}

function decoded(segment) {
  try {
    return decodeURIComponent(segment);
  } catch {
    return segment; // a stray % was typed: the page will say that no such bearing exists
  }
}
