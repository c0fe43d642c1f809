// Images as half floats, and the colours in which a viewer shows them. Joined with panes.js and viewer.js into one script.
const HALVES = 65536;
// Added to the squared reference, as in relMSE, and to the reference of the signed difference.
const EPSILON = 0.01;
// Anchors of the colour map magma, from low to high.
const MAGMA = [[0, 0, 4], [59, 15, 112], [140, 41, 129], [222, 73, 104], [254, 159, 109], [252, 253, 191]];
// Colours of a pixel that is darker or brighter than the reference.
const DARKER = [70, 150, 255];
const BRIGHTER = [255, 140, 30];

const floatOfHalf = new Float32Array(HALVES);
for (let bits = 0; bits < HALVES; bits++) {
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  const sign = bits & 0x8000 ? -1 : 1;
  if (exponent === 31) floatOfHalf[bits] = fraction ? NaN : sign * Infinity;
  else if (exponent === 0) floatOfHalf[bits] = sign * fraction * 2 ** -24;
  else floatOfHalf[bits] = sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

const luminance = (r, g, b) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

// sRGB code of every half float at this exposure. What is no number is black.
function displayCodes(stops) {
  const codes = new Uint8Array(HALVES);
  const gain = 2 ** stops;
  for (let bits = 0; bits < HALVES; bits++) {
    const v = floatOfHalf[bits] * gain;
    if (v > 0) codes[bits] = Math.round(255 * (v >= 1 ? 1 : v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  }
  return codes;
}

// Entry of the colour map for 0 to 1.
const magma = Array.from({ length: 256 }, (_, i) => {
  const at = (i / 255) * (MAGMA.length - 1);
  const low = Math.min(Math.floor(at), MAGMA.length - 2);
  return MAGMA[low].map((v, c) => Math.round(v + (at - low) * (MAGMA[low + 1][c] - v)));
});
const magmaAt = (t) => magma[t >= 0 ? Math.min(255, Math.round(255 * t)) : 0];

// One image of a section. Its pixels are decoded when they are first asked for.
class Shot {
  constructor(figure) {
    const { name, key, width, height, left, top } = figure.dataset;
    Object.assign(this, { figure, name, key, width: +width, height: +height, left: +left, top: +top });
    this.isReference = "reference" in figure.dataset;
  }

  get halves() {
    if (!this.decoded) {
      const bytes = atob(this.figure.querySelector("script").textContent.trim());
      this.decoded = new Uint16Array(bytes.length / 2);
      for (let i = 0; i < this.decoded.length; i++) {
        this.decoded[i] = bytes.charCodeAt(2 * i) | (bytes.charCodeAt(2 * i + 1) << 8);
      }
    }
    return this.decoded;
  }

  at(x, y) {
    const i = 3 * (y * this.width + x);
    return [0, 1, 2].map((c) => floatOfHalf[this.halves[i + c]]);
  }
}

const signedDifference = (a, b) => (a - b) / (Math.abs(b) + EPSILON);
const squaredError = (a, b) => a.reduce((sum, v, c) => sum + (v - b[c]) ** 2 / (b[c] ** 2 + EPSILON), 0) / 3;

// Colours of all pixels of an image in the state's mode, as RGBA.
function paint(shot, reference, state) {
  const out = new Uint8ClampedArray(4 * shot.width * shot.height).fill(255);
  const comparable = reference && reference.width === shot.width && reference.height === shot.height;
  const colour = state.difference && comparable ? differenceColour(shot, reference, state) : plainColour(shot, state);
  for (let i = 0, o = 0; o < out.length; i += 3, o += 4) {
    const [r, g, b] = colour(i);
    out[o] = r;
    out[o + 1] = g;
    out[o + 2] = b;
  }
  return new ImageData(out, shot.width, shot.height);
}

function plainColour(shot, state) {
  const halves = shot.halves;
  if (state.falseColour) {
    const value = (i) => luminance(floatOfHalf[halves[i]], floatOfHalf[halves[i + 1]], floatOfHalf[halves[i + 2]]);
    return (i) => magmaAt((Math.log2(value(i)) + state.stops + 8) / 12);
  }
  const codes = displayCodes(state.stops);
  return (i) => [codes[halves[i]], codes[halves[i + 1]], codes[halves[i + 2]]];
}

function differenceColour(shot, reference, state) {
  const gain = 2 ** state.stops;
  const rgb = (halves, i) => [floatOfHalf[halves[i]], floatOfHalf[halves[i + 1]], floatOfHalf[halves[i + 2]]];
  const [a, b] = [shot.halves, reference.halves];
  if (state.falseColour) {
    return (i) => magmaAt((Math.log10(squaredError(rgb(a, i), rgb(b, i)) * gain) + 5) / 6);
  }
  return (i) => {
    const v = clamp(gain * signedDifference(luminance(...rgb(a, i)), luminance(...rgb(b, i))), -1, 1) || 0;
    return (v < 0 ? DARKER : BRIGHTER).map((c) => c * Math.abs(v));
  };
}
