/** Where the player's samples are from: the newest of the unit, or a recording, piece by piece. */

import { ask } from "../api.js";
import { clipOf } from "../charts/orbit_clip.js";

/** How much of the newest samples the service holds, s. */
const HELD_S = 10;

/** A piece of a recording, s, and how much of it lies before what was asked for: the trail. */
const PIECE_S = 40;
const LEAD_S = 12;

/** So long before its end the next piece is asked for, s. */
const AHEAD_S = 10;

/** This near its end a piece is over, s: it breaks off where the device began to count anew. */
const END_S = 0.1;

/** The newest samples; `loops` while they are looked at more slowly than they come. */
export function liveSource(path) {
  return {
    isLive: true,
    async clip(_atS, signal) {
      return clipOf(await ask([...path, "motion"], [["seconds", String(HELD_S)]], signal));
    },
    needs: () => true,
  };
}

/** A recording; after a break it continues behind the break. */
export function recordedSource(recording, bearing) {
  async function piece(startS, signal) {
    const query = [["bearing", bearing], ["start_s", startS.toFixed(3)], ["seconds", String(PIECE_S)]];
    return clipOf(await ask(["recordings", recording, "motion"], query, signal));
  }
  return {
    isLive: false,
    async clip(atS, signal) {
      const found = await piece(Math.max(0, atS - LEAD_S), signal);
      const breaksOff = found.endS < atS + END_S && found.endS < found.total_s - END_S;
      return breaksOff ? piece(Math.max(atS, found.endS + 1 / found.rate_hz), signal) : found;
    },
    /** Whether another piece is needed to play on from here. */
    needs(clip, atS) {
      if (clip === null) return true;
      const isBefore = atS < clip.startS + Math.min(LEAD_S / 2, clip.startS);
      const isBehind = atS > clip.endS - AHEAD_S && clip.endS < clip.total_s - END_S;
      return isBefore || isBehind;
    },
  };
}
