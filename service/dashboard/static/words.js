/** Codes of the API in words for people. */

const REASONS = {
  ok: ["good", "Everything needed is there."],
  waiting_for_data: ["waiting for data", "The first full segment has not been recorded yet."],
  not_connected: ["not connected", "No samples come from the data acquisition unit."],
  stale: ["data too old", "No new samples have arrived lately."],
  sensor_failure: ["sensor failure", "A transducer reports a fault or its voltage is outside its OK limits."],
  clipped: ["signal clipped", "The signal exceeds the range of the converter."],
  not_finite: ["not a number", "The calculation gave no finite number."],
  not_measured: ["not measured", "Nothing measures this here."],
  out_of_range: ["out of range", "The reading lies outside its plausible range."],
  speed_unknown: ["speed unknown", "Without the speed, the 1× frequency is not known."],
  standstill: ["standing still", "The shaft does not turn."],
  few_segments: ["short record", "Few segments have been averaged yet; the numbers scatter more."],
  no_vortex: ["no vortex", "No line stands out where a part-load vortex would be."],
  outside_band: ["line outside band", "A line below 1× stands out beside the band in which the vortex is looked for; see vortex_band in the plant file."],
  low_coverage: ["gaps in the record", "Samples are missing in the averaged window."],
  insufficient_excitation: ["weak signal", "The motion is too small to tell stiffness from noise."],
  poor_fit: ["poor fit", "One constant film does not explain the motion at all frequencies; see the lack of fit."],
  channel_delay: ["channels out of step?", "The bearing channels seem to be late or early against the shaft channels; or the bracket’s mass or a transducer’s response is wrong."],
  estimators_disagree: ["estimators disagree", "Two ways to measure this film differ by more than chance and the stated limits explain: a transducer’s response, runout or bracket may be other than stated."],
  switched_off: ["switched off", "This estimate is switched off for this bearing in the plant file."],
  dead: ["no signal", "A transducer’s output rests at zero while the machine turns; its cable or supply may be broken."],
  stuck: ["signal stuck", "A transducer’s output does not move while the machine turns."],
  swapped_axes: ["backward whirl?", "The shaft seems to whirl against its rotation: two probes may be exchanged, or one may count the wrong way."],
  polarity: ["wrong sign?", "The film’s stiffness or damping reads negative: a shaft or bearing transducer of this direction counts the wrong way. Check its type, its direction and its wiring."],
  speed_implausible: ["speed implausible", "The measured speed does not agree with the vibration or with the rated speed."],
  non_stationary: ["operation changing", "Speed or load moved during the averaged window."],
  power_unknown: ["power unknown", "The power is not known, so that the load may have changed during the averaged window."],
  reduced_probes: ["fewer probes", "A probe has failed; the shaft centre comes from the remaining ones, less certain."],
  bracket_unknown: ["bracket unknown", "The bracket’s stiffness is not in the plant file, so only ratios to it are known."],
  service_not_reachable: ["service not reachable", "The padwatch service does not answer this browser."],
};

/** Readings with one of these reasons are absent because nothing current arrives at all. */
export const NOT_CURRENT = new Set(["not_connected", "stale", "waiting_for_data", "service_not_reachable"]);

/** Reasons for a missing number that belong to ordinary operation and need no action. */
const ORDINARY = new Set([
  "waiting_for_data",
  "not_measured",
  "standstill",
  "few_segments",
  "no_vortex",
  "insufficient_excitation",
  "switched_off",
  "non_stationary",
  "bracket_unknown",
]);

/** How a quality looks: `good`, `uncertain`, `bad`, or a quiet `absent` for an ordinary absence. */
export function lookOf(level, reason) {
  return level === "bad" && ORDINARY.has(reason) ? "absent" : level;
}

/**
 * The quality of a bearing as a whole, or of its first reading that is bad for no ordinary reason:
 * a broken sensor must not hide behind a quiet absence.
 */
export function qualityOf({ quality, readings, bad_reasons: reasons, doubtful_signs: signs }) {
  if (quality.level === "bad" && lookOf(quality.level, quality.reason) === "bad") return quality;
  if (signs?.length) return { level: "uncertain", reason: "polarity", words: `check the sign of ${signs.join(" or ")}` };
  const found = reasons?.map((reason) => ({ level: "bad", reason })) ?? Object.values(readings);
  return found.find(({ level, reason }) => lookOf(level, reason) === "bad") ?? quality;
}

/** A few words for a table cell. */
export function reasonWords(reason) {
  return REASONS[reason]?.[0] ?? reason.replaceAll("_", " ");
}

/** Where there is room for one word or two only. */
const BRIEF = {
  waiting_for_data: "waiting",
  stale: "data old",
  sensor_failure: "sensor fails",
  standstill: "standstill",
  low_coverage: "gaps",
  speed_implausible: "speed wrong?",
  speed_unknown: "no speed",
  non_stationary: "changing",
  service_not_reachable: "unknown",
};

/** A word or two for one of many tiles. */
export const briefWords = (reason) => BRIEF[reason] ?? reasonWords(reason);

/** A sentence for the bearing page. */
export function reasonSentence(reason) {
  return REASONS[reason]?.[1] ?? `${reasonWords(reason)}.`;
}

const ESTIMATORS = {
  dynamic: "broadband estimate",
  transfer_order1: "transfer at 1×",
  transfer_vortex: "transfer at vortex",
  ratio_order1: "equation (5) at 1×",
  ratio_vortex: "equation (5) at vortex",
};

/** An estimator of film stiffness in words; nothing for none. */
export function estimatorWords(name) {
  return name === null ? "" : (ESTIMATORS[name] ?? name.replaceAll("_", " "));
}

const RUNOUT = {
  applied: "taken off",
  no_vector: "not taken off: no slow-roll vector",
  other_probe: "not taken off: the slow-roll vector is of another probe",
  not_slow_roll: "not taken off: the vector was not measured at slow roll",
  no_phase_reference: "not taken off: no key-phase",
};

/** Whether the shaft's runout is taken off at 1×, in words, once if it is the same in x and y. */
export function runoutWords(runout) {
  if (!runout) return "";
  const [x, y] = ["shaft_x", "shaft_y"].map((shaft) => RUNOUT[runout[shaft]] ?? "");
  return x === y ? x : `x ${x}, y ${y}`;
}

const SPEED_SOURCES = {
  key_phase: "measured by key-phase",
  slow_channel: "measured",
  line: "from the 1× line",
  rated: "rated value, not measured",
};

/** Where the shown speed comes from; nothing while none is shown. */
export function speedOrigin({ readings, speed_source: source }) {
  if (source === null || (readings.speed_rpm?.value ?? null) === null) return "";
  return SPEED_SOURCES[source] ?? source.replaceAll("_", " ");
}

const SOURCE_STATES = {
  connected: { level: "good", words: "Connected" },
  connecting: { level: "uncertain", words: "Connecting" },
  not_connected: { level: "bad", words: "Not connected" },
  ended: { level: "absent", words: "Replay finished" },
  unknown: { level: "bad", words: "State unknown" },
};

/** Level and words for the link to a unit's data acquisition. */
export function sourceState(state) {
  return SOURCE_STATES[state] ?? { level: "uncertain", words: state.replaceAll("_", " ") };
}
