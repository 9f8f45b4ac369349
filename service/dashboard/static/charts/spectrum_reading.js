/** What is read off a spectrum: its axis in three units, its peaks between lines, its harmonics. */

/** Axes by name; `of` turns Hz into the unit of the axis, `turnHz` is the running speed. */
export const AXES = {
  hz: { title: "Frequency, Hz", unit: "Hz", of: (hz) => hz },
  cpm: { title: "Frequency, cycles per minute", unit: "cpm", of: (hz) => 60 * hz },
  orders: { title: "Multiple of the running speed", unit: "×", of: (hz, turnHz) => (turnHz ? hz / turnHz : null) },
};

/** A peak stands out by this factor from the median of so many lines on either side. */
const PROMINENCE = 3;
const AROUND = 12;

const MOST_PEAKS = 8;
export const HARMONICS = 6;

/**
 * The true line between three spectral lines about `at`: `{ hz, um }`.
 *
 * For a steady sine in Hann's window the ratio of the two largest lines gives the offset exactly, and the
 * offset gives the amplitude (Harris 1978). A broader hump is no sine: it stays on its line.
 */
function between(frequencyHz, amplitude, at) {
  const [before, um, after] = [amplitude[at - 1] ?? 0, amplitude[at], amplitude[at + 1] ?? 0];
  const ratio = Math.max(before, after) / um;
  const offset = Math.min(Math.max((2 * ratio - 1) / (1 + ratio), 0), 0.5);
  const loss = offset < 1e-6 ? 1 : Math.sin(Math.PI * offset) / (Math.PI * offset * (1 - offset ** 2));
  return { hz: frequencyHz[at] + (after > before ? offset : -offset) * frequencyHz[0], um: um / loss };
}

/** The largest peaks from a frequency on, the largest first: `{ hz, um }`, µm zero-to-peak. */
export function peaksOf(frequencyHz, amplitude, fromHz) {
  const isPeak = (um, n) => {
    if (frequencyHz[n] < fromHz || !(um > (amplitude[n - 1] ?? 0) && um >= (amplitude[n + 1] ?? 0))) return false;
    const around = amplitude.slice(Math.max(n - AROUND, 0), n + AROUND + 1).toSorted((a, b) => a - b);
    return um > PROMINENCE * around[Math.floor(around.length / 2)];
  };
  const peaks = amplitude.flatMap((um, n) => (isPeak(um, n) ? [between(frequencyHz, amplitude, n)] : []));
  return peaks.toSorted((a, b) => b.um - a.um).slice(0, MOST_PEAKS);
}

/** A frequency and its multiples within the spectrum: `{ hz, um }`, µm of the peak on or beside each. */
export function harmonicsOf(frequencyHz, amplitude, hz) {
  const found = [];
  for (let n = 1; n <= HARMONICS && n * hz <= frequencyHz.at(-1); n += 1) {
    const line = Math.max(Math.round((n * hz) / frequencyHz[0]) - 1, 0);
    const beside = [line - 1, line, line + 1].filter((at) => amplitude[at] !== undefined);
    const highest = beside.reduce((best, at) => (amplitude[at] > amplitude[best] ? at : best));
    found.push({ hz: n * hz, um: between(frequencyHz, amplitude, highest).um });
  }
  return found;
}
