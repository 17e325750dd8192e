// The player of a report page: one slider, and everything that follows it. All data lie in the page; nothing is loaded.
"use strict";
(() => {
  const PERIOD_MS = 100; // between two steps while playing
  const player = document.getElementById("player");
  const { labels, steps } = JSON.parse(document.getElementById("player-data").textContent);
  const slider = document.getElementById("slider");
  const plot = document.getElementById("plot");
  const cursor = document.getElementById("cursor");
  const controls = player.querySelector(".controls");
  const button = controls.querySelector("button");
  const frames = [...player.querySelectorAll(".frame")];
  const values = [...player.querySelectorAll(".now td.n")];
  const dots = [...cursor.querySelectorAll("circle")];
  const last = steps.length - 1;
  let asked = 0;
  let shown = 0;
  let timer = 0;

  // A decoded image, or null where there is none or its data are broken.
  async function load(source) {
    if (source === null) return null;
    const image = new Image();
    image.src = source;
    try {
      await image.decode();
    } catch {
      return null;
    }
    return image;
  }

  function place(frame, image, label, time) {
    frame.querySelector("img")?.remove();
    if (image) {
      image.alt = `${label} at ${time}`;
      frame.prepend(image);
    }
    frame.classList.toggle("lost", !image);
    frame.querySelector(".gap span:last-child").textContent = time;
  }

  // Waits until every picture of the step is decoded or known to be missing, so that all views change at once.
  async function show(number) {
    const turn = ++asked;
    const step = steps[number];
    const images = await Promise.all(step.pictures.map(load));
    if (turn < shown) return; // what was asked for later is on the page already
    shown = turn;
    frames.forEach((frame, i) => place(frame, images[i], labels[i], step.time));
    values.forEach((cell, i) => { cell.textContent = step.values[i]; });
    cursor.setAttribute("transform", `translate(${step.x} 0)`);
    dots.forEach((dot, i) => {
      dot.setAttribute("visibility", step.y[i] === null ? "hidden" : "visible");
      dot.setAttribute("cy", step.y[i] ?? 0);
    });
    document.getElementById("time").textContent = `t = ${step.time}`;
    document.getElementById("count").textContent = `step ${number + 1} of ${steps.length}`;
    slider.setAttribute("aria-valuetext", step.time);
    player.dataset.step = number;
  }

  function go(number) {
    slider.value = number;
    show(number);
  }

  function stop() {
    clearInterval(timer);
    timer = 0;
    button.textContent = "play";
  }

  function advance() {
    if (slider.valueAsNumber < last) go(slider.valueAsNumber + 1);
    if (slider.valueAsNumber >= last) stop();
  }

  function toggle() {
    if (timer) return stop();
    if (slider.valueAsNumber >= last) go(0);
    button.textContent = "pause";
    timer = setInterval(advance, PERIOD_MS);
  }

  // To the step nearest to the pointer, while its button is down.
  function seek(event) {
    if (!(event.buttons & 1)) return;
    const box = plot.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * plot.viewBox.baseVal.width;
    const distance = steps.map((step) => Math.abs(step.x - x));
    go(distance.indexOf(Math.min(...distance)));
  }

  slider.addEventListener("input", () => show(slider.valueAsNumber));
  button.addEventListener("click", toggle);
  plot.addEventListener("pointerdown", seek);
  plot.addEventListener("pointermove", seek);
  controls.hidden = false;
  show(slider.valueAsNumber);
})();
