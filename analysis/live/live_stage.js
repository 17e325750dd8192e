"use strict";
// The two pictures: under a wipe, or side by side.
const Stage = (() => {
  const canvas = document.getElementById("stage");
  const wipe = document.getElementById("wipe");
  const beside = document.getElementById("beside");
  const pictures = { left: null, right: null };
  let share = 0.5;

  // Takes the pixels of a side, three bytes each.
  function put(side, width, height, bytes) {
    let one = pictures[side];
    if (!one || one.width !== width || one.height !== height) {
      one = pictures[side] = document.createElement("canvas");
      one.width = width;
      one.height = height;
      one.image = new ImageData(width, height);
      one.image.data.fill(255);
    }
    const target = one.image.data;
    for (let from = 0, to = 0; from < bytes.length; from += 3, to += 4) {
      target[to] = bytes[from];
      target[to + 1] = bytes[from + 1];
      target[to + 2] = bytes[from + 2];
    }
    one.getContext("2d").putImageData(one.image, 0, 0);
  }

  function drop(side) {
    pictures[side] = null;
  }

  // Where a picture of a size goes within a part of the canvas: as large as fits, whole pixels when enlarged.
  function place(one, x, width, height) {
    const scale = Math.min(width / one.width, height / one.height);
    const whole = scale >= 2 ? Math.floor(scale) : scale;
    const wide = one.width * whole;
    const high = one.height * whole;
    return { x: x + (width - wide) / 2, y: (height - high) / 2, wide, high, enlarged: whole >= 1 };
  }

  function paint(context, one, at) {
    context.imageSmoothingEnabled = !at.enlarged;
    context.drawImage(one, at.x, at.y, at.wide, at.high);
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio);
    const height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const context = canvas.getContext("2d");
    context.fillStyle = "#181818";
    context.fillRect(0, 0, width, height);
    const { left, right } = pictures;
    const both = left && right;
    wipe.hidden = !both || beside.checked;
    if (both && beside.checked) {
      paint(context, left, place(left, 0, width / 2 - 2, height));
      paint(context, right, place(right, width / 2 + 2, width / 2 - 2, height));
      return;
    }
    if (!both) {
      const one = left || right;
      if (one) paint(context, one, place(one, 0, width, height));
      return;
    }
    const at = place(left, 0, width, height);
    const edge = at.x + share * at.wide;
    for (const [one, from, to] of [[left, 0, edge], [right, edge, width]]) {
      context.save();
      context.beginPath();
      context.rect(from, 0, to - from, height);
      context.clip();
      paint(context, one, place(one, 0, width, height));
      context.restore();
    }
    wipe.style.left = `${edge / ratio}px`;
  }

  function wiped(to) {
    share = Math.min(1, Math.max(0, to));
    wipe.setAttribute("aria-valuenow", Math.round(100 * share));
    draw();
  }

  wipe.addEventListener("pointerdown", (event) => wipe.setPointerCapture(event.pointerId));
  wipe.addEventListener("pointermove", (event) => {
    if (!wipe.hasPointerCapture(event.pointerId) || !pictures.left) return;
    const box = canvas.getBoundingClientRect();
    const at = place(pictures.left, 0, box.width, box.height);
    wiped((event.clientX - box.left - at.x) / at.wide);
  });
  wipe.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    wiped(share + step);
  });
  beside.addEventListener("change", draw);
  window.addEventListener("resize", draw);
  return { put, drop, draw };
})();
