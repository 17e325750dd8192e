// Pictures of the page: decoded, coloured, exposed, and compared with their references.
"use strict";
const Pictures = (given) => {
  const palettes = Object.fromEntries(
    Object.entries(given.palettes).map(([name, text]) => [name, Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]),
  );
  const panels = new Map(given.panels.map((panel) => [panel.label, panel]));
  const labels = given.panels.map((panel) => panel.label);

  // Keeps the newest results of a function of a key.
  function kept(most, made) {
    const found = new Map();
    return (key, ...more) => {
      const value = found.has(key) ? found.get(key) : made(key, ...more);
      found.delete(key);
      found.set(key, value);
      if (found.size > most) found.delete(found.keys().next().value);
      return value;
    };
  }

  // A decoded picture by its number, or null if its data are damaged.
  const image = kept(240, async (number) => {
    const one = new Image();
    one.src = document.getElementById(`picture-${number}`).textContent;
    try {
      await one.decode();
    } catch {
      return null;
    }
    return one;
  });

  function surface(width, height) {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [width, height];
    return canvas;
  }

  function codesOf(picture) {
    const canvas = surface(picture.naturalWidth, picture.naturalHeight);
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(picture, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  }

  // Codes of a picture by its number.
  const codes = kept(16, async (number) => {
    const picture = await image(number);
    return picture && codesOf(picture);
  });

  function drawn(width, height, ink) {
    const canvas = surface(width, height);
    const context = canvas.getContext("2d");
    const data = context.createImageData(width, height);
    ink(new Uint32Array(data.data.buffer));
    context.putImageData(data, 0, 0);
    return canvas;
  }

  const packed = (r, g, b) => (255 << 24) | (b << 16) | (g << 8) | r;
  const ofPalette = (name) =>
    Uint32Array.from({ length: 256 }, (_, i) => packed(...palettes[name].subarray(3 * i, 3 * i + 3)));

  // The value of a byte of a map; null where it has none.
  function valueOf(scale, byte) {
    return byte ? scale.bounds[0] * (scale.bounds[1] / scale.bounds[0]) ** ((byte - 1) / 254) : null;
  }

  const inksOf = kept(40, (key, scale) => {
    const [inks, [low, high]] = [ofPalette(scale.palette), scale.shown.map(Math.log)];
    return Uint32Array.from({ length: 256 }, (_, byte) => {
      if (byte === 0) return packed(...scale.special);
      const share = (Math.log(valueOf(scale, byte)) - low) / Math.max(high - low, 1e-12);
      return inks[Math.round(255 * Math.min(1, Math.max(0, share)))];
    });
  });

  function mapped(data, panel) {
    const inks = inksOf(panel.label, panel.scale);
    return drawn(data.width, data.height, (to) => {
      for (let i = 0; i < to.length; i++) to[i] = inks[data.data[4 * i]];
    });
  }

  // Multiplies linear light by two to the power of the stops; input and output are display codes.
  function exposed(data, stops) {
    const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    const code = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
    const table = Uint8Array.from({ length: 256 }, (_, i) =>
      Math.round(255 * Math.min(1, code(linear(i / 255) * 2 ** stops))),
    );
    return drawn(data.width, data.height, (to) => {
      for (let i = 0, j = 0; i < to.length; i++, j += 4)
        to[i] = packed(table[data.data[j]], table[data.data[j + 1]], table[data.data[j + 2]]);
    });
  }

  // Ends of the colour scale of errors; exposure narrows them.
  function range(mode, stops) {
    const most = { signed: 0.25, squared: 0.1, flip: 1 }[mode] / 2 ** (mode === "squared" ? 2 * stops : stops);
    return mode === "signed" ? [-most, most] : mode === "squared" ? [most / 1e4, most] : [0, most];
  }

  // Position of an error between the ends of the scale, from 0 to 1; squared errors have a logarithmic scale.
  function place(mode, value, [low, high]) {
    const share = mode === "squared" ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low);
    return Math.min(1, Math.max(0, share));
  }

  const errors = kept(6, async (key, mode, number, truth) => {
    const [shown, reference] = await Promise.all([codes(number), codes(truth)]);
    if (!shown || !reference || shown.width !== reference.width || shown.height !== reference.height) return null;
    const values = Errors[mode](shown.data, reference.data, shown.width, shown.height);
    return { values, width: shown.width, height: shown.height };
  });

  function errorsOf(step, label, mode) {
    const [number, truth] = [numberOf(step, label), numberOf(step, panels.get(label).truth)];
    return number === null || truth === null ? null : errors(`${mode} ${number} ${truth}`, mode, number, truth);
  }

  const numberOf = (step, label) => given.steps[step].pictures[labels.indexOf(label)] ?? null;

  // The image of a panel at a step; null if there is none.
  async function layer(step, label, mode, stops) {
    const [panel, number] = [panels.get(label), numberOf(step, label)];
    if (number === null) return null;
    if (panel.scale) {
      const data = await codes(number);
      return data && mapped(data, panel);
    }
    if (mode === "picture" || !panel.truth) {
      if (!stops || mode !== "picture") return image(number);
      const data = await codes(number);
      return data && exposed(data, stops);
    }
    const found = await errorsOf(step, label, mode);
    if (!found) return null;
    const [inks, ends] = [ofPalette(given.errors[mode]), range(mode, stops)];
    return drawn(found.width, found.height, (to) => {
      for (let i = 0; i < to.length; i++) to[i] = inks[Math.round(255 * place(mode, found.values[i], ends))];
    });
  }

  // Colour scale of a panel: palette, ends, unit; null for pictures.
  function scaleOf(label, mode, stops) {
    const panel = panels.get(label);
    if (panel.scale) {
      const { palette, shown, unit, meaning, special } = panel.scale;
      return { palette, ends: shown, unit, meaning, special };
    }
    if (mode === "picture" || !panel.truth) return null;
    const unit = { signed: "shown minus reference", squared: "squared error", flip: "FLIP" }[mode];
    return { palette: given.errors[mode], ends: range(mode, stops), unit, meaning: "" };
  }

  // A strip of the colours of a palette.
  function bar(name) {
    const inks = ofPalette(name);
    return drawn(256, 1, (to) => to.set(inks));
  }

  return { panels, labels, layer, codes, numberOf, errorsOf, scaleOf, valueOf, bar, layersReady: image };
};
