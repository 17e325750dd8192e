// Errors of pictures, pixel by pixel. All take display-encoded codes, 4 bytes a pixel, and return a number a pixel.
"use strict";
const Errors = (() => {
  const CODES = Float32Array.from({ length: 256 }, (_, i) => i / 255);
  const LINEAR = CODES.map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));

  // Mean difference of the channels, from -1 to 1: shown minus reference.
  function signed(shown, truth) {
    const found = new Float32Array(shown.length / 4);
    for (let i = 0, j = 0; i < found.length; i++, j += 4)
      found[i] = (shown[j] + shown[j + 1] + shown[j + 2] - truth[j] - truth[j + 1] - truth[j + 2]) / 765;
    return found;
  }

  // Mean squared difference of the channels, from 0 to 1.
  function squared(shown, truth) {
    const found = new Float32Array(shown.length / 4);
    for (let i = 0, j = 0; i < found.length; i++, j += 4) {
      const [r, g, b] = [shown[j] - truth[j], shown[j + 1] - truth[j + 1], shown[j + 2] - truth[j + 2]];
      found[i] = (r * r + g * g + b * b) / 195075;
    }
    return found;
  }

  // FLIP of Andersson et al. 2020 for displays of low dynamic range, at its default of 67 pixels a degree.
  const DEGREE_PX = (0.7 * 3840 * Math.PI) / (0.7 * 180);
  const TO_XYZ = [
    [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
    [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
    [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
  ];
  const WHITE = TO_XYZ.map((row) => row[0] + row[1] + row[2]);
  const FROM_XYZ = inverse(TO_XYZ);

  function inverse(m) {
    const c = (i, j) => {
      const [a, b, d, e] = [(i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3];
      return m[a][d] * m[b][e] - m[a][e] * m[b][d];
    };
    const det = m[0][0] * c(0, 0) + m[0][1] * c(0, 1) + m[0][2] * c(0, 2);
    return [0, 1, 2].map((i) => [0, 1, 2].map((j) => c(j, i) / det));
  }

  // A row of taps from -radius to radius.
  function taps(radius, of) {
    return Float64Array.from({ length: 2 * radius + 1 }, (_, i) => of(i - radius));
  }

  // Convolves rows and columns; pixels beyond the border repeat those at the border.
  function convolved(plane, w, h, across, down) {
    const turned = passed(plane, w, h, across);
    return passed(turned, h, w, down);
  }

  // One pass along the rows; the result is transposed.
  function passed(plane, w, h, kernel) {
    const found = new Float32Array(plane.length);
    const radius = (kernel.length - 1) / 2;
    const row = new Float32Array(w + 2 * radius);
    for (let y = 0; y < h; y++) {
      row.set(plane.subarray(y * w, (y + 1) * w), radius);
      row.fill(plane[y * w], 0, radius);
      row.fill(plane[(y + 1) * w - 1], w + radius);
      for (let x = 0; x < w; x++) {
        let sum = 0;
        for (let k = 0; k < kernel.length; k++) sum += kernel[k] * row[x + k];
        found[x * h + y] = sum;
      }
    }
    return found;
  }

  // Luminance and two opponent colours, linear in light.
  function opponent(codes) {
    const count = codes.length / 4;
    const planes = [0, 1, 2].map(() => new Float32Array(count));
    for (let i = 0, j = 0; i < count; i++, j += 4) {
      const [r, g, b] = [LINEAR[codes[j]], LINEAR[codes[j + 1]], LINEAR[codes[j + 2]]];
      const [x, y, z] = TO_XYZ.map((row, k) => (row[0] * r + row[1] * g + row[2] * b) / WHITE[k]);
      planes[0][i] = 116 * y - 16;
      planes[1][i] = 500 * (x - y);
      planes[2][i] = 200 * (y - z);
    }
    return planes;
  }

  const CURVE = (t) => (t > 0.008856451679 ? Math.cbrt(t) : t / 0.128418549 + 4 / 29);

  // Lab with colours weighted by lightness (Hunt), from linear RGB.
  function lab(r, g, b) {
    const [x, y, z] = TO_XYZ.map((row, k) => CURVE((row[0] * r + row[1] * g + row[2] * b) / WHITE[k]));
    const light = 116 * y - 16;
    return [light, 0.01 * light * 500 * (x - y), 0.01 * light * 200 * (y - z)];
  }

  const apart = (p, q) => Math.abs(p[0] - q[0]) + Math.hypot(p[1] - q[1], p[2] - q[2]);
  const GREATEST = apart(lab(0, 1, 0), lab(0, 0, 1)) ** 0.7;

  // Weights and widths of the Gaussians whose sums model the eye's blur of luminance, red-green and blue-yellow.
  const EYE = [[[1, 0.0047]], [[1, 0.0053]], [[34.1, 0.04], [13.5, 0.025]]];
  const RADIUS = Math.ceil(3 * Math.sqrt(0.04 / (2 * Math.PI ** 2)) * DEGREE_PX);

  function blurred(plane, w, h, parts) {
    const made = parts.map(([weight, width]) => {
      const scale = Math.sqrt(weight * Math.sqrt(Math.PI / width));
      return taps(RADIUS, (d) => scale * Math.exp(-(((Math.PI * d) / DEGREE_PX) ** 2) / width));
    });
    const total = made.reduce((sum, kernel) => sum + kernel.reduce((a, b) => a + b) ** 2, 0);
    const found = new Float32Array(plane.length);
    for (const kernel of made) {
      const one = convolved(plane, w, h, kernel, kernel);
      for (let i = 0; i < found.length; i++) found[i] += one[i] / total;
    }
    return found;
  }

  // Strength of edges and points in luminance.
  function features(light, w, h) {
    const plane = light.map((y) => (y + 16) / 116);
    const deviation = 0.5 * 0.082 * DEGREE_PX;
    const radius = Math.ceil(3 * deviation);
    const bell = (d) => Math.exp((-d * d) / (2 * deviation ** 2));
    const normal = taps(radius, bell).map((v, _, all) => v / all.reduce((a, b) => a + b));
    return [(d) => -d * bell(d), (d) => ((d / deviation) ** 2 - 1) * bell(d)].map((of) => {
      const raw = taps(radius, of);
      const [up, down] = [raw.filter((v) => v > 0), raw.filter((v) => v < 0)].map((part) => Math.abs(part.reduce((a, b) => a + b)));
      const kernel = raw.map((v) => v / (v > 0 ? up : down));
      const [x, y] = [convolved(plane, w, h, kernel, normal), convolved(plane, w, h, normal, kernel)];
      return x.map((v, i) => Math.hypot(v, y[i]));
    });
  }

  function seen(codes, w, h) {
    const planes = opponent(codes);
    const strengths = features(planes[0], w, h);
    const eyed = planes.map((plane, k) => blurred(plane, w, h, EYE[k]));
    return { strengths, eyed };
  }

  function perceived(eyed, i) {
    const y = (eyed[0][i] + 16) / 116;
    const xyz = [(y + eyed[1][i] / 500) * WHITE[0], y * WHITE[1], (y - eyed[2][i] / 200) * WHITE[2]];
    const rgb = FROM_XYZ.map((row) => Math.min(1, Math.max(0, row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])));
    return lab(...rgb);
  }

  // FLIP error, from 0 (no visible difference) to 1.
  function flip(shown, truth, w, h) {
    const [a, b] = [seen(shown, w, h), seen(truth, w, h)];
    const found = new Float32Array(w * h);
    const knee = 0.4 * GREATEST;
    for (let i = 0; i < found.length; i++) {
      const power = apart(perceived(a.eyed, i), perceived(b.eyed, i)) ** 0.7;
      const colour = power < knee ? (0.95 / knee) * power : 0.95 + ((power - knee) / (GREATEST - knee)) * 0.05;
      const feature = Math.max(...[0, 1].map((k) => Math.abs(a.strengths[k][i] - b.strengths[k][i])));
      found[i] = colour ** (1 - Math.sqrt(feature / Math.SQRT2));
    }
    return found;
  }

  return { signed, squared, flip };
})();
