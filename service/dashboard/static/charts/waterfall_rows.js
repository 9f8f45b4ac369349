/** Spectra over time as rows to draw: along Hz or along orders, with empty rows where time has holes. */

/** Times further apart than this many usual steps, of their neighbourhood, have a hole between them. */
const HOLE_STEPS = 2.5;

/** Milliseconds that a date axis shows as the browser's local time. */
export function localMs(timeS) {
  const ms = timeS * 1000;
  return ms - new Date(ms).getTimezoneOffset() * 60000;
}

/** Rows of one channel, oldest first: `{ timeS, amplitude, order1Hz, vortexHz, index }`, amplitude in µm or null. */
export function rowsOf(spectra, place) {
  return spectra.channels[place].amplitude.map((amplitude, index) => ({
    index,
    timeS: spectra.time[index],
    amplitude,
    order1Hz: spectra.order1_hz[index],
    vortexHz: spectra.vortex_hz[index],
  }));
}

/** The same along orders of the running speed: the largest line that falls on each step. */
export function alongOrders(rows, frequencyHz, orders) {
  return rows.map((row) => ({ ...row, amplitude: row.order1Hz && row.amplitude ? stepped(row, frequencyHz, orders) : null }));
}

function stepped({ amplitude, order1Hz }, frequencyHz, orders) {
  const binHz = frequencyHz[0];
  const half = (orders[1] - orders[0]) / 2;
  return orders.map((order) => {
    const first = Math.max(Math.ceil(((order - half) * order1Hz) / binHz), 1);
    const last = Math.floor(((order + half) * order1Hz) / binHz);
    if (first > amplitude.length) return null;
    if (last < first) return amplitude[Math.max(Math.round((order * order1Hz) / binHz), 1) - 1] ?? null;
    return amplitude.slice(first - 1, last).reduce((most, um) => Math.max(most, um));
  });
}

/** Even orders, as dense as the lines at the usual running speed, up to where these end. */
export function ordersOf(rows, frequencyHz) {
  const turns = rows.map(({ order1Hz }) => order1Hz).filter(Boolean);
  if (turns.length === 0) return [];
  const usual = turns.toSorted((a, b) => a - b)[Math.floor(turns.length / 2)];
  const step = frequencyHz[0] / usual;
  return Array.from({ length: frequencyHz.length }, (_, n) => (n + 1) * step);
}

/** How long one spectrum alone is drawn, s: with no neighbour nothing says how long it stands for. */
const ALONE_S = 60;

/** Rows with an empty one at each end of every hole, so that nothing is drawn over it. */
export function withHoles(rows) {
  if (rows.length === 1) return [empty(rows[0].timeS - ALONE_S), ...rows, empty(rows[0].timeS + ALONE_S)];
  return rows.flatMap((row, n) => {
    const next = rows[n + 1];
    const usualS = next ? usualStepS(rows, n) : null;
    if (!next || next.timeS - row.timeS <= HOLE_STEPS * usualS) return [row];
    return [row, empty(row.timeS + usualS), empty(next.timeS - usualS)];
  });
}

const empty = (timeS) => ({ index: null, timeS, amplitude: null, order1Hz: null, vortexHz: null });

/** The larger of the steps beside this one: spectra lie sparser the older they are. */
function usualStepS(rows, n) {
  const step = (at) => (rows[at] && rows[at + 1] ? rows[at + 1].timeS - rows[at].timeS : 0);
  return Math.max(step(n - 1), step(n + 1)) || step(n);
}
