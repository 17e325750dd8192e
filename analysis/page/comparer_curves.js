// The curves beside the comparer: a cursor at the moment that is shown, and what they say of it.
"use strict";

const seconds = (t) => `${t.toFixed(3)} s`;

function short(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "—";
  const size = Math.abs(value);
  return size !== 0 && (size >= 1e4 || size < 1e-2) ? value.toExponential(2) : String(Number(value.toPrecision(3)));
}

// `given` are the data of the page; `go` takes the number of the step under a pressed pointer.
function Curves(given, go) {
  const plots = [...document.querySelectorAll("svg.plot")];
  const [start, end] = given.span;

  // The last value of a curve that is not later.
  function valueAt(curve, time) {
    let [low, high] = [0, curve.times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (curve.times[middle] <= time + 1e-6) low = middle + 1;
      else high = middle;
    }
    return low ? curve.values[low - 1] : null;
  }

  function show(step) {
    const { time } = given.steps[step];
    plots.forEach((plot, number) => {
      const { left, right } = plot.dataset;
      const x = Number(left) + ((time - start) / (end - start || 1)) * (right - left);
      plot.querySelector(".cursor").setAttribute("transform", `translate(${x.toFixed(2)} 0)`);
      const said = given.plots[number].curves.map((curve) => `${curve.label} ${short(valueAt(curve, time))}`);
      plot.closest("figure").querySelector(".reading").textContent = `${seconds(time)}: ${said.join(", ")}`;
    });
  }

  // Moves to the step nearest to the pointer while its button is down.
  function seek(event) {
    if (!(event.buttons & 1)) return;
    const plot = event.currentTarget;
    const box = plot.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * plot.viewBox.baseVal.width;
    const share = (x - plot.dataset.left) / (plot.dataset.right - plot.dataset.left);
    const apart = given.steps.map((step) => Math.abs(step.time - start - share * (end - start)));
    go(apart.indexOf(Math.min(...apart)));
  }
  for (const plot of plots) for (const name of ["pointerdown", "pointermove"]) plot.addEventListener(name, seek);

  return { show };
}
