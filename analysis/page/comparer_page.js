// The comparer of a page: one moment in time, and everything that depends on it. All data are in the page.
"use strict";
(() => {
  const root = document.getElementById("comparer");
  if (!root) return;
  const given = JSON.parse(document.getElementById("comparer-data").textContent);
  const pictures = Pictures(given);
  const one = (selector) => root.querySelector(selector);
  const all = (selector) => [...root.querySelectorAll(selector)];
  const [slider, play, speed, exposure] = ["#slider", "#play", "#speed", "#exposure"].map(one);
  const choice = { left: one("#left"), right: one("#right") };
  const last = given.steps.length - 1;
  const now = { step: 0, mode: "picture", stops: 0, holding: false, pixel: null };
  let [turn, shownTurn, moving, native] = [0, 0, null, { width: 1, height: 1 }];

  const stage = Stage(one("#stage"), one("#wipe"), (pixel) => {
    now.pixel = pixel ?? now.pixel;
    zoomSaid();
    look();
  });

  const curves = Curves(given, (step) => {
    if (moving) stop();
    go(step);
  });
  function sides() {
    const truth = (label) => pictures.panels.get(label).truth;
    const shown = [choice.left.value, choice.right.value];
    if (!now.holding) return shown;
    const reference = shown.map(truth).find(Boolean) ?? given.panels.find((panel) => !panel.truth && !panel.scale)?.label;
    return reference ? [reference, reference] : shown;
  }

  // Waits until both layers are ready, so that they change together; a later request wins.
  async function show() {
    const mine = ++turn;
    const { step, mode, stops } = now;
    const labels = sides();
    const layers = await Promise.all(labels.map((label) => pictures.layer(step, label, mode, stops)));
    if (mine < shownTurn) return;
    shownTurn = mine;
    layers.forEach((layer, i) => {
      if (layer && !pictures.panels.get(labels[i]).scale)
        native = { width: layer.naturalWidth ?? layer.width, height: layer.naturalHeight ?? layer.height };
    });
    stage.show(...layers, native);
    root.dataset.step = step;
    root.dataset.shown = labels.join(" | ");
    scales(labels);
    zoomSaid();
    if (!moving) look();
  }

  function scales(labels) {
    all(".scale").forEach((box, i) => {
      const scale = pictures.scaleOf(labels[i], now.mode, now.stops);
      box.hidden = !scale;
      if (!scale) return;
      const canvas = box.querySelector("canvas");
      canvas.getContext("2d").drawImage(pictures.bar(scale.palette), 0, 0);
      const [low, unit, high] = box.querySelectorAll("span");
      [low.textContent, high.textContent] = scale.ends.map(short);
      unit.textContent = `${labels[i]}: ${scale.unit}`;
      const key = box.querySelector(".special");
      key.hidden = !scale.meaning;
      key.textContent = scale.meaning;
      key.style.setProperty("--ink", scale.special ? `rgb(${scale.special})` : "none");
    });
  }

  function zoomSaid() {
    const scale = stage.scale();
    one("#zoom").textContent = scale >= 1 ? `${Math.round(scale)}:1` : `1:${(1 / scale).toFixed(1)}`;
  }

  // Thumbnails of the step; while playing they wait.
  let thumbed = 0;
  async function thumbs() {
    const mine = ++thumbed;
    for (const button of all(".thumb")) {
      const label = given.panels[button.dataset.panel].label;
      const layer = await pictures.layer(now.step, label, "picture", 0);
      if (mine !== thumbed) return;
      const canvas = button.querySelector("canvas");
      const context = canvas.getContext("2d");
      context.clearRect(0, 0, canvas.width, canvas.height);
      if (layer) {
        context.imageSmoothingQuality = "high";
        canvas.height = Math.round((canvas.width * native.height) / native.width) || canvas.width;
        context.drawImage(layer, 0, 0, canvas.width, canvas.height);
      }
      button.classList.toggle("lost", !layer);
    }
  }

  function marked() {
    for (const button of all(".thumb")) {
      const label = given.panels[button.dataset.panel].label;
      const on = [choice.left.value === label && "left", choice.right.value === label && "right"].filter(Boolean);
      button.querySelector(".side").textContent = on.join(" and ");
      button.setAttribute("aria-pressed", on.length > 0);
    }
  }

  // Pixels around the cursor, and their values.
  const RADIUS = 5;
  async function look() {
    if (!now.pixel) return;
    const { step, mode } = now;
    const at = now.pixel.map(Math.floor);
    const [left, right] = [choice.left.value, choice.right.value];
    const truth = [left, right].map((label) => pictures.panels.get(label).truth).find(Boolean);
    for (const [place, label] of [["reference", truth], ["left", left], ["right", right]]) {
      const row = one(`#loupe-${place}`);
      const canvas = row.querySelector("canvas");
      const context = canvas.getContext("2d");
      const number = label ? pictures.numberOf(step, label) : null;
      const layer = number === null ? null : await pictures.layer(step, label, place === "reference" ? "picture" : mode, now.stops);
      const codes = number === null ? null : await pictures.codes(number);
      context.clearRect(0, 0, canvas.width, canvas.height);
      row.querySelector(".name").textContent = label ?? "—";
      const cells = row.querySelectorAll("td.n");
      if (!layer || !codes) {
        cells.forEach((cell) => { cell.textContent = "—"; });
        continue;
      }
      const share = [codes.width / native.width, codes.height / native.height];
      const [x, y] = [Math.floor(at[0] * share[0]), Math.floor(at[1] * share[1])];
      context.imageSmoothingEnabled = false;
      const side = 2 * RADIUS + 1;
      context.drawImage(layer, x - RADIUS, y - RADIUS, side, side, 0, 0, canvas.width, canvas.height);
      const cell = canvas.width / side;
      context.strokeStyle = "#fff";
      context.strokeRect(RADIUS * cell - 0.5, RADIUS * cell - 0.5, cell + 1, cell + 1);
      const i = 4 * (y * codes.width + x);
      const panel = pictures.panels.get(label);
      cells[0].textContent = panel.scale
        ? `${short(pictures.valueOf(panel.scale, codes.data[i]))} ${panel.scale.unit}`
        : [...codes.data.subarray(i, i + 3)].join(" ");
      const kind = mode === "picture" ? "signed" : mode;
      const found = panel.truth && !panel.scale ? await pictures.errorsOf(step, label, kind) : null;
      cells[1].textContent = found ? `${short(found.values[y * found.width + x])}` : "";
    }
    one("#loupe-at").textContent = `pixel ${at[0]}, ${at[1]}`;
  }

  function cursors() {
    const said = seconds(given.steps[now.step].time);
    curves.show(now.step);
    one("#time").textContent = said;
    one("#count").textContent = `${now.step + 1} of ${last + 1}`;
    slider.value = now.step;
    slider.setAttribute("aria-valuetext", said);
  }

  function go(step) {
    now.step = Math.min(last, Math.max(0, step));
    cursors();
    if (!moving) thumbs();
    return show();
  }

  // Plays in real time times the factor; steps that are not ready in time are skipped, so that the speed holds.
  function toggle() {
    if (moving) return stop();
    if (now.step >= last) go(0);
    const factor = Number(speed.value);
    moving = { from: given.steps[now.step].time, began: performance.now(), factor, busy: false, shown: 0 };
    play.textContent = "pause";
    requestAnimationFrame(tick);
  }

  function stop() {
    moving = null;
    play.textContent = "play";
    thumbs();
    look();
  }

  function tick(at) {
    if (!moving) return;
    const run = moving;
    const passed = Math.max(0, at - run.began) / 1000;
    const time = run.from + passed * run.factor;
    let step = now.step;
    while (step < last && given.steps[step + 1].time <= time + 1e-6) step++;
    if (step !== now.step && !run.busy) {
      run.busy = true;
      go(step).then(() => { run.busy = false; run.shown++; });
      if (passed > 0.3) one("#rate").textContent = `${(run.shown / passed).toFixed(0)} images a second`;
    }
    if (now.step >= last && !run.busy) return stop();
    requestAnimationFrame(tick);
  }

  function redraw() {
    marked();
    return show();
  }

  function hold(on) {
    if (now.holding === on) return;
    now.holding = on;
    one("#hold").classList.toggle("down", on);
    show();
  }

  slider.addEventListener("input", () => { if (moving) stop(); go(slider.valueAsNumber); });
  play.addEventListener("click", toggle);
  speed.addEventListener("change", () => { if (moving) { stop(); toggle(); } });
  exposure.addEventListener("input", () => {
    now.stops = exposure.valueAsNumber;
    const said = `${now.stops > 0 ? "+" : ""}${now.stops} EV`;
    one("#stops").textContent = said;
    exposure.setAttribute("aria-valuetext", said);
    show();
  });
  for (const box of Object.values(choice)) box.addEventListener("change", redraw);
  for (const radio of all("input[name=mode]"))
    radio.addEventListener("change", () => { now.mode = radio.value; redraw(); });
  one("#beside").addEventListener("change", (event) => { stage.view.beside = event.target.checked; stage.draw(); zoomSaid(); });
  one("#swap").addEventListener("click", swap);
  one("#closer").addEventListener("click", () => stage.step(true, now.pixel));
  one("#farther").addEventListener("click", () => stage.step(false, now.pixel));
  one("#fit").addEventListener("click", () => stage.fit());
  one("#native").addEventListener("click", () => stage.zoomTo(1));
  one("#hold").addEventListener("pointerdown", () => hold(true));
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur"]) one("#hold").addEventListener(name, () => hold(false));
  for (const button of all(".thumb"))
    button.addEventListener("click", (event) => {
      choice[event.shiftKey ? "left" : "right"].value = given.panels[button.dataset.panel].label;
      redraw();
    });

  function swap() {
    [choice.left.value, choice.right.value] = [choice.right.value, choice.left.value];
    redraw();
  }

  const KEYS = {
    ArrowRight: () => go(now.step + 1), ArrowLeft: () => go(now.step - 1), Home: () => go(0), End: () => go(last),
    " ": toggle, x: swap, "+": () => stage.step(true, now.pixel), "-": () => stage.step(false, now.pixel),
    0: () => stage.fit(), 1: () => stage.zoomTo(1),
    e: () => {
      const radios = all("input[name=mode]");
      const next = radios[(radios.findIndex((radio) => radio.checked) + 1) % radios.length];
      next.checked = true;
      now.mode = next.value;
      redraw();
    },
  };
  // A control that was clicked leaves space and arrows to the page; one that was reached by the keyboard keeps its own.
  let [clicked, pointed] = [null, false];
  document.addEventListener("pointerdown", () => [clicked, pointed] = [null, true], true);
  for (const kind of ["click", "change"])
    document.addEventListener(kind, (event) => {
      const opens = kind === "click" && event.target.matches("select"); // keys then go through its list
      if (pointed && !opens) clicked = document.activeElement;
    });
  document.addEventListener("keydown", (event) => {
    pointed = false;
    if (event.key === "Tab") clicked = null;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "r") return hold(true);
    const at = event.target;
    const own = at.matches?.("select, summary, input[type=radio], #exposure") || (event.key === " " && at.matches?.("button, input[type=checkbox]"));
    if ((own && at !== clicked) || !KEYS[event.key]) return;
    event.preventDefault();
    if (moving && event.key !== " ") stop();
    KEYS[event.key]();
  });
  document.addEventListener("keyup", (event) => event.key === "r" && hold(false));
  window.addEventListener("blur", () => hold(false));
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));

  root.classList.add("live");
  [choice.left.value, choice.right.value] = [given.left, given.right];
  all(".thumb").forEach((button) => {
    button.querySelector("img")?.remove();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [192, 192];
    button.prepend(canvas);
  });
  marked();
  go(0);
})();
