// Sounds of a game, which are off until a person wants them: a capture is struck, a crash rustles, a win rises.

const NOTES = { captured: [196, 147, 98], crashed: [90], won: [392, 494, 587, 784] }; // [Hz]
const LENGTH = 0.16; // of a note [s]

let context = null;

/** Switch sounds on or off; returns whether they are on. */
export function toggleSound() {
  if (context) context.close();
  context = context ? null : new AudioContext();
  return context !== null;
}

/** Play one of `NOTES`, if sounds are on. */
export function sound(name) {
  NOTES[name].forEach((pitch, index) => context && play(pitch, context.currentTime + 0.7 * LENGTH * index, name === "crashed" ? "sawtooth" : "triangle"));
}

function play(pitch, at, type) {
  const [tone, volume] = [new OscillatorNode(context, { frequency: pitch, type }), new GainNode(context, { gain: 0 })];
  volume.gain.setValueAtTime(0.2, at);
  volume.gain.exponentialRampToValueAtTime(1e-3, at + 2 * LENGTH);
  tone.connect(volume).connect(context.destination);
  tone.start(at);
  tone.stop(at + 2 * LENGTH);
}
