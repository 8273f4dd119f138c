// Arrays of small integers, as base64 of their little-endian bytes.

const KINDS = { int16: Int16Array, uint16: Uint16Array, uint8: Uint8Array };
const LOST_JOINT = -32768; // of a joint, where the tracker lost people

function decoded(text, kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new KINDS[kind](bytes.buffer);
}

// Viewpoints: distance [m], azimuth and polar angle [rad], one after another.
function viewpointsOf(text) {
  const whole = decoded(text, "uint16");
  const scale = [1 / 100, Math.PI / 18000, Math.PI / 18000];
  return Float64Array.from(whole, (value, at) => value * scale[at % 3]);
}

function pointAt(viewpoints, frame) {
  const [distance, azimuth, polar] = viewpoints.subarray(3 * frame, 3 * frame + 3);
  const level = distance * Math.sin(polar);
  return [level * Math.cos(azimuth), level * Math.sin(azimuth), distance * Math.cos(polar)];
}

// What the planners did in an episode, decoded when it is shown.
function decodedEpisode(episode) {
  if (episode.decoded === undefined) {
    const cast = Object.entries(episode.planners).map(([name, of]) => [
      name,
      {
        path: viewpointsOf(of.path),
        target: of.target === null ? null : viewpointsOf(of.target),
        sensed: decoded(of.sensed, "int16"),
        missed: decoded(of.missed, "uint8"),
        belief: decoded(of.belief, "uint16"),
        field: of.field === null ? null : { ...of.field, values: decoded(of.field.values, "uint8") },
      },
    ]);
    episode.decoded = {
      labels: decoded(episode.labels, "uint16"),
      centre: episode.centre === null ? null : Float64Array.from(decoded(episode.centre, "int16"), (value) => value / 100),
      people: Float64Array.from(decoded(episode.people, "int16"), (value) => (value === LOST_JOINT ? NaN : value / 1000)),
      passers: episode.passers === null ? null : Float64Array.from(decoded(episode.passers, "int16"), (value) => value / 1000),
      cast: Object.fromEntries(cast),
    };
  }
  return episode.decoded;
}
