// The stage: two layers under a wipe or side by side, zoomed and moved together, in native pixels.
"use strict";
const Stage = (canvas, handle, onMove) => {
  const context = canvas.getContext("2d");
  const view = { zoom: 0, x: 0.5, y: 0.5, wipe: 0.5, beside: false }; // zoom 0 fits; x, y: share in the middle
  let layers = { left: null, right: null };
  let size = { width: 1, height: 1 }; // of the pictures
  const pointers = new Map();
  let gesture = null;

  const ratio = () => window.devicePixelRatio || 1;
  const panes = () => (view.beside ? 2 : 1);

  // Device pixels for a pixel of the fitted picture: an integer if possible.
  function fitting() {
    const scale = Math.min(canvas.width / panes() / size.width, canvas.height / size.height);
    return scale >= 1 ? Math.floor(scale) : scale;
  }

  const scale = () => view.zoom || fitting();

  // Left upper corner of the picture within a pane, device pixels.
  function corner() {
    const [w, h] = [canvas.width / panes(), canvas.height];
    const at = (length, room, share) =>
      length <= room ? (room - length) / 2 : Math.min(0, Math.max(room - length, room / 2 - share * length));
    return [Math.round(at(size.width * scale(), w, view.x)), Math.round(at(size.height * scale(), h, view.y))];
  }

  function painted(layer, left, clip) {
    const [x, y] = corner();
    context.save();
    context.beginPath();
    context.rect(...clip);
    context.clip();
    if (layer) {
      context.imageSmoothingEnabled = scale() < 1;
      context.imageSmoothingQuality = "high";
      context.drawImage(layer, left + x, y, size.width * scale(), size.height * scale());
    } else {
      context.fillStyle = "#3a3a3a";
      context.fillRect(left + x, y, size.width * scale(), size.height * scale());
      context.fillStyle = "#f0f0f0";
      context.font = `${14 * ratio()}px system-ui, sans-serif`;
      context.textAlign = "center";
      context.fillText("missing", Math.min(Math.max(left + x + (size.width * scale()) / 2, clip[0] + 40), clip[0] + clip[2] - 40), y + 40 * ratio());
    }
    context.restore();
  }

  // Position of the wipe, device pixels.
  function wipeX() {
    const [x, width] = [corner()[0], size.width * scale()];
    const [from, to] = [Math.max(0, x), Math.min(canvas.width, x + width)];
    return Math.round(from + view.wipe * (to - from));
  }

  function draw() {
    const [w, h] = [canvas.width, canvas.height];
    context.clearRect(0, 0, w, h);
    const middle = view.beside ? Math.round(w / 2) : wipeX();
    painted(layers.left, 0, [0, 0, middle, h]);
    painted(layers.right, view.beside ? middle : 0, [middle, 0, w - middle, h]);
    handle.style.left = `${(100 * middle) / w}%`;
    handle.setAttribute("aria-valuenow", Math.round(100 * view.wipe));
    handle.classList.toggle("fixed", view.beside);
  }

  function resize() {
    const box = canvas.getBoundingClientRect();
    [canvas.width, canvas.height] = [Math.max(1, Math.round(box.width * ratio())), Math.max(1, Math.round(box.height * ratio()))];
    draw();
  }

  function show(left, right, native) {
    [layers, size] = [{ left, right }, native];
    draw();
  }

  // Position in the picture under a pointer, in fractional pixels; null if there is none.
  function pixel(event) {
    const box = canvas.getBoundingClientRect();
    let x = (event.clientX - box.left) * (canvas.width / box.width);
    if (view.beside && x >= canvas.width / 2) x -= canvas.width / 2;
    const [left, top] = corner();
    const at = [(x - left) / scale(), ((event.clientY - box.top) * (canvas.height / box.height) - top) / scale()];
    return at[0] >= 0 && at[1] >= 0 && at[0] < size.width && at[1] < size.height ? at : null;
  }

  // Zooms to a number of device pixels a pixel, about a pixel that does not move.
  function zoomTo(next, about) {
    const least = fitting();
    next = Math.min(64, Math.max(next, Math.min(least, 1)));
    const at = about ?? [view.x * size.width, view.y * size.height];
    const [x, y] = corner();
    const screen = [x + at[0] * scale(), y + at[1] * scale()];
    view.zoom = next;
    const [w, h] = [canvas.width / panes(), canvas.height];
    view.x = (at[0] + (w / 2 - screen[0]) / next) / size.width;
    view.y = (at[1] + (h / 2 - screen[1]) / next) / size.height;
    hold();
    draw();
    onMove(null);
  }

  function fit() {
    [view.zoom, view.x, view.y] = [0, 0.5, 0.5];
    draw();
    onMove(null);
  }

  // Steps of zoom: integers of device pixels, or halvings of the picture.
  function step(up, about) {
    const now = scale();
    const steps = [0.125, 0.25, 0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64];
    const next = up ? steps.find((s) => s > now * 1.001) : steps.findLast((s) => s < now * 0.999);
    if (next) zoomTo(next, about);
  }

  function hold() {
    for (const [name, room, length] of [["x", canvas.width / panes(), size.width], ["y", canvas.height, size.height]]) {
      const half = room / 2 / (length * scale());
      view[name] = half >= 0.5 ? 0.5 : Math.min(1 - half, Math.max(half, view[name]));
    }
  }

  const enlarged = () => size.width * scale() > canvas.width / panes() + 1 || size.height * scale() > canvas.height + 1;

  function wipeTo(share) {
    view.wipe = Math.min(1, Math.max(0, share));
    draw();
  }

  function wipeAt(event) {
    const box = canvas.getBoundingClientRect();
    const [x, width] = [corner()[0], size.width * scale()];
    const [from, to] = [Math.max(0, x), Math.min(canvas.width, x + width)];
    wipeTo(((event.clientX - box.left) * (canvas.width / box.width) - from) / (to - from));
  }

  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  };

  canvas.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
    if (pointers.size === 2) gesture = { kind: "pinch", from: spread(), zoom: scale(), about: pixel(event) };
    else gesture = { kind: enlarged() || view.beside ? "move" : "wipe", x: event.clientX, y: event.clientY };
    if (gesture.kind === "wipe") wipeAt(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (pointers.has(event.pointerId)) pointers.set(event.pointerId, event);
    if (gesture?.kind === "pinch" && pointers.size === 2) zoomTo((gesture.zoom * spread()) / gesture.from, gesture.about);
    else if (gesture?.kind === "wipe") wipeAt(event);
    else if (gesture?.kind === "move") {
      const box = canvas.getBoundingClientRect();
      const device = canvas.width / box.width / scale();
      view.x -= ((event.clientX - gesture.x) * device) / size.width;
      view.y -= ((event.clientY - gesture.y) * device) / size.height;
      [gesture.x, gesture.y] = [event.clientX, event.clientY];
      hold();
      draw();
    }
    onMove(pixel(event));
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => {
      pointers.delete(event.pointerId);
      gesture = null;
    });
  canvas.addEventListener("wheel", (event) => {
    const at = pixel(event);
    if (!at || (event.deltaY > 0 && scale() <= fitting())) return; // the page scrolls
    event.preventDefault();
    step(event.deltaY < 0, at);
  }, { passive: false });
  handle.addEventListener("pointerdown", (event) => handle.setPointerCapture(event.pointerId));
  handle.addEventListener("pointermove", (event) => event.buttons & 1 && !view.beside && wipeAt(event));
  handle.addEventListener("keydown", (event) => {
    const moved = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
    if (moved === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    wipeTo(view.wipe + moved);
  });
  new ResizeObserver(resize).observe(canvas);

  return { view, show, draw, step, zoomTo, fit, scale, wipeTo };
};
