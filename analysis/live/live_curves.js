"use strict";
// Curves of the last ten seconds, a line and a label a side.
const Curves = (() => {
  const NAMES = ["cycle_ms", "age_ms", "predicted"];
  const SPAN_S = 10;
  const SVG = "http://www.w3.org/2000/svg";
  const seen = { left: [], right: [] };
  let drawn = 0;

  function element(name, attributes, text) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    return made;
  }

  function add(time, sides) {
    for (const side of ["left", "right"]) {
      const facts = sides[side];
      if (facts && facts.number !== undefined) seen[side].push({ time, name: facts.name, ...facts });
      else seen[side] = [];
      const before = seen[side].findIndex((one) => one.time >= time - SPAN_S && one.time <= time && one.name === facts.name);
      seen[side] = before < 0 ? [] : seen[side].slice(before);
    }
    if (performance.now() - drawn > 200) {
      drawn = performance.now();
      for (const name of NAMES) draw(name, time);
    }
  }

  function draw(name, time) {
    const plot = document.getElementById(`curve-${name}`);
    const lines = ["left", "right"].map((side) => seen[side].filter((one) => one[name] != null));
    const values = lines.flat().map((one) => one[name]);
    const most = Math.max(1e-9, ...values);
    const step = 10 ** Math.floor(Math.log10(most));
    const top = Math.ceil(most / step) * step;
    const x = (t) => 34 + 270 * (1 - (time - t) / SPAN_S);
    const y = (value) => 98 - 88 * (value / top);
    const parts = (values.length ? [0, top] : []).map((value) => [
      element("line", { x1: 34, x2: 304, y1: y(value), y2: y(value), class: "grid" }),
      element("text", { x: 30, y: y(value) + 4, "text-anchor": "end" }, Number(value.toPrecision(2))),
    ]).flat();
    const ends = [];
    const said = [];
    lines.forEach((line, index) => {
      if (!line.length) return;
      const points = line.map((one) => `${x(one.time).toFixed(1)},${y(one[name]).toFixed(1)}`).join(" ");
      parts.push(element("polyline", { points, class: `curve ink-${index}` }));
      const last = line[line.length - 1];
      ends.push({ at: y(last[name]) + 4, text: `${last.name} ${Number(last[name].toPrecision(3))}`, index });
      said.push(`${last.name} ${Number(last[name].toPrecision(3))}`);
    });
    ends.sort((a, b) => a.at - b.at);
    if (ends.length === 2 && ends[1].at - ends[0].at < 14) {
      const middle = Math.min(90, (ends[0].at + ends[1].at) / 2);
      ends[0].at = middle - 7;
      ends[1].at = middle + 7;
    }
    for (const end of ends) parts.push(element("text", { x: 309, y: end.at, class: `said-${end.index}` }, end.text));
    if (!said.length) parts.push(element("text", { x: 170, y: 58, "text-anchor": "middle" }, "no run here can tell"));
    plot.replaceChildren(...parts);
    plot.setAttribute("aria-label", `${plot.previousElementSibling.textContent}: ${said.join(", ") || "none"}`);
  }

  return { add };
})();
