// The explorer of a report page: points of two quantities, with their settings and pictures. All data are in the page.
"use strict";
(() => {
  const root = document.getElementById("explorer");
  const given = JSON.parse(document.getElementById("explorer-data").textContent);
  const plot = root.querySelector("svg");
  const choice = (name) => root.querySelector(`select[name=${name}]`).value;
  const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [720, 460, 64, 706, 10, 416];
  let picked = null;

  function made(tag, attributes, text) {
    const element = document.createElementNS(plot.namespaceURI, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    plot.append(element);
    return element;
  }

  // Maps values to positions on a logarithmic axis; JOD, which may be negative, has a linear axis.
  function axis(values, low, high, logarithmic) {
    const scaled = logarithmic ? Math.log10 : (v) => v;
    const ends = [Math.min(...values.map(scaled)), Math.max(...values.map(scaled))];
    const margin = Math.max(0.04 * (ends[1] - ends[0]), 0.02);
    const [from, to] = [ends[0] - margin, ends[1] + margin];
    const place = (value) => low + ((scaled(value) - from) / (to - from)) * (high - low);
    const ticks = [];
    if (logarithmic) {
      const steps = to - from < 1.2 ? [1, 1.5, 2, 3, 5, 7] : to - from < 2.5 ? [1, 2, 5] : [1];
      for (let power = Math.floor(from); power <= to; power++)
        for (const step of steps) ticks.push(step * 10 ** power);
    } else {
      const step = 10 ** Math.floor(Math.log10(to - from));
      for (let k = Math.ceil(from / step); k * step <= to; k++) ticks.push(k * step);
    }
    return { place, ticks: ticks.filter((t) => scaled(t) >= from && scaled(t) <= to) };
  }

  function short(value) {
    const size = Math.abs(value);
    return size !== 0 && (size >= 1e4 || size < 1e-2) ? value.toExponential(1) : String(Number(value.toPrecision(3)));
  }

  function tell(point) {
    root.querySelector(".title").textContent = point.title;
    const table = root.querySelector("table");
    table.replaceChildren();
    for (const [name, value] of Object.entries(point.values)) {
      const row = table.insertRow();
      row.insertCell().textContent = name;
      const cell = row.insertCell();
      cell.className = "n";
      cell.textContent = value === null ? "—" : short(value);
    }
  }

  function picture(label, name) {
    const shown = document.createElement("figure");
    const image = new Image();
    image.src = given.pictures[name];
    image.alt = label;
    const caption = document.createElement("figcaption");
    caption.textContent = label;
    shown.style.margin = 0;
    shown.append(image, caption);
    return shown;
  }

  function pick(point, dot) {
    picked = point;
    plot.querySelector(".picked")?.classList.remove("picked");
    dot.classList.add("picked");
    tell(point);
    const pictures = root.querySelector(".pictures");
    pictures.replaceChildren();
    if (given.pictures[point.picture]) pictures.append(picture("shown", point.picture));
    const truth = given.truths[point.group];
    if (given.pictures[truth]) pictures.append(picture("reference", truth));
  }

  // Points on the Pareto front, by rising cost; lower is better, except for JOD.
  function front(points, x, y, sign) {
    const sorted = [...points].sort((a, b) => a.values[x] - b.values[x] || sign * (a.values[y] - b.values[y]));
    const kept = [];
    for (const point of sorted)
      if (!kept.length || sign * point.values[y] < sign * kept[kept.length - 1].values[y]) kept.push(point);
    return kept;
  }

  function draw() {
    const [group, x, y] = [choice("group"), choice("across"), choice("upward")];
    const linear = y === "JOD";
    const drawable = (value, straight) => value !== null && (straight || value > 0);
    const points = given.points.filter(
      (p) => p.group === group && drawable(p.values[x], false) && drawable(p.values[y], linear),
    );
    plot.replaceChildren();
    if (!points.length) {
      made("text", { x: WIDTH / 2, y: HEIGHT / 2, "text-anchor": "middle" }, "not measured");
      return;
    }
    const across = axis(points.map((p) => p.values[x]), LEFT, RIGHT, true);
    const upward = axis(points.map((p) => p.values[y]), BOTTOM, TOP, !linear);
    for (const tick of across.ticks) {
      const at = across.place(tick);
      made("line", { x1: at, x2: at, y1: TOP, y2: BOTTOM, class: "grid" });
      made("text", { x: at, y: BOTTOM + 16, "text-anchor": "middle" }, short(tick));
    }
    for (const tick of upward.ticks) {
      const at = upward.place(tick);
      made("line", { x1: LEFT, x2: RIGHT, y1: at, y2: at, class: "grid" });
      made("text", { x: LEFT - 6, y: at + 4, "text-anchor": "end" }, short(tick));
    }
    made("text", { x: (LEFT + RIGHT) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, x);
    made("text", { x: 12, y: TOP + 8 }, y);
    const best = front(points, x, y, linear ? -1 : 1);
    let path = "";
    for (const point of best) {
      const at = `${across.place(point.values[x])} ${upward.place(point.values[y])}`;
      path += path ? `H${across.place(point.values[x])}V${upward.place(point.values[y])}` : `M${at}`;
    }
    made("path", { d: path, class: "front" });
    for (const point of points) {
      const place = [across.place(point.values[x]), upward.place(point.values[y])];
      const mark = { d: given.shapes[point.kind], fill: given.colours[point.kind], transform: `translate(${place})` };
      const dot = made("path", { ...mark, class: "dot", tabindex: 0, role: "button" });
      dot.setAttribute("aria-label", point.title);
      if (point === picked) dot.classList.add("picked");
      dot.addEventListener("mouseenter", () => tell(point));
      dot.addEventListener("focus", () => tell(point));
      dot.addEventListener("mouseleave", () => picked && picked.group === group && tell(picked));
      dot.addEventListener("click", () => pick(point, dot));
      dot.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          pick(point, dot);
        }
      });
    }
  }

  for (const select of root.querySelectorAll("select")) select.addEventListener("change", draw);
  draw();
})();
