"use strict";
// The connection, and the controls.
const root = document.getElementById("live");
const part = (id) => document.getElementById(id);
const token = document.querySelector("meta[name=token]").content;
const SILENCE_MS = 30000;
const rates = { left: null, right: null };
let socket = null;
let state = null;
let lost = 0;
let heard = performance.now();

function tell(message) {
  if (socket && socket.readyState === WebSocket.OPEN && state && state.drives) socket.send(JSON.stringify(message));
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/watch?token=${encodeURIComponent(token)}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { heard = performance.now(); };
  socket.onmessage = (event) => {
    lost = 0;
    heard = performance.now();
    take(event.data);
    socket.send("drawn");
  };
  socket.onclose = () => {
    part("status").textContent = "connection lost; trying again";
    part("status").classList.add("lost");
    root.dataset.state = "lost";
    lost += 1;
    setTimeout(again, 400);
  };
}

// A server that has gone without a word is given up; a live view always has something to say.
setInterval(() => {
  if (performance.now() - heard > SILENCE_MS && socket.readyState === WebSocket.OPEN && !document.hidden) socket.close();
}, 1000);

// A server that was begun anew knows nothing of this page's token: the page is asked for anew.
async function again() {
  if (lost > 1) {
    const found = await fetch(location.href, { cache: "no-store" }).catch(() => null);
    if (found && found.ok) {
      const text = await found.text();
      if (!text.includes(token)) {
        location.reload();
        return;
      }
    }
  }
  connect();
}

function take(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  for (const side of ["left", "right"]) {
    const facts = header.sides[side];
    if (facts.bytes) {
      Stage.put(side, facts.width, facts.height, new Uint8Array(data, at, facts.bytes));
      at += facts.bytes;
    } else if (facts.number === undefined) {
      Stage.drop(side);
    }
  }
  Stage.draw();
  show(header);
  Curves.add(header.time_s, header.sides);
  root.dataset.frames = Number(root.dataset.frames) + 1;
}

function set(id, property, value) {
  const one = part(id);
  if (one[property] !== value && document.activeElement !== one) one[property] = value;
}

function options(select, labels) {
  const given = [...select.options].map((one) => one.value);
  if (given.join("\n") !== labels.join("\n")) {
    select.replaceChildren(...labels.map((label) => new Option(label, label)));
  }
}

function show(header) {
  state = header;
  const status = part("status");
  status.classList.remove("lost");
  root.dataset.state = header.drives ? "drives" : "watches";
  const pages = header.watchers > 1 ? `; ${header.watchers} pages are open` : "";
  status.textContent = `${header.drives ? "this page drives" : "another page drives"}${pages}`;
  part("drive").hidden = header.drives;
  for (const one of document.querySelectorAll("[data-driven]")) one.disabled = !header.drives;
  if (header.note) {
    part("note").textContent = header.note;
    part("note").hidden = false;
  }
  const { animation, controls, frozen } = header;
  part("playing").textContent = animation.playing ? "stop" : "play";
  set("scrub", "max", String(animation.duration_s || 1));
  set("scrub", "value", String(animation.at_s));
  part("scrub").disabled = animation.duration_s <= 0;
  part("at").textContent = `${animation.at_s.toFixed(2)} s`;
  set("repeats", "checked", animation.repeats);
  set("ride", "checked", header.rides);
  set("strength", "value", String(header.strength));
  for (const one of document.querySelectorAll("[data-control]")) {
    const value = String(controls[one.dataset.control]);
    if (one.dataset.steps) {
      const at = steps(one).indexOf(value);
      if (document.activeElement !== one && at >= 0) one.value = String(at);
      one.setAttribute("aria-valuetext", value);
    } else if (document.activeElement !== one && one.value !== value) {
      if (one.tagName === "SELECT" && ![...one.options].some((each) => each.value === value)) one.add(new Option(value));
      one.value = value;
    }
    const said = document.querySelector(`output[for=${one.id}]`);
    if (said) said.textContent = value;
  }
  for (const side of ["left", "right"]) {
    const facts = header.sides[side];
    const select = part(`o-${side}`);
    const chosen = header.overlay[side];
    options(select, [...new Set([...(facts.overlays || ["none"]), chosen])]);
    if (document.activeElement !== select) select.value = chosen;
    part(`${side}-said`).textContent = said(side, facts, header);
    const key = part(`${side}-key`);
    if (facts.colours) key.style.background = facts.colours.length ? `linear-gradient(to right, ${facts.colours})` : "";
    key.hidden = !key.style.background;
  }
  part("freeze").textContent = frozen ? "go on" : "freeze and compare with the truth";
  part("freeze").setAttribute("aria-pressed", String(Boolean(frozen)));
  part("record").hidden = header.recording !== null;
  part("save").hidden = header.recording === null;
  part("save").textContent = `stop and save ${(header.recording || 0).toFixed(1)} s`;
  table(frozen);
}

// The values of a slider whose steps are not even.
function steps(one) {
  return one.dataset.steps.split(" ");
}

function said(side, facts, header) {
  if (!facts.name) return "";
  if (facts.error) return `${facts.name}: ${facts.error}`;
  if (facts.number === undefined) return `${facts.name}: first picture to come`;
  const before = rates[side];
  if (!before || before.name !== facts.name || header.time_s - before.time > 1 || facts.cycles < before.cycles) {
    const gone = before && before.name === facts.name ? header.time_s - before.time : 0;
    const rate = gone > 0 ? (facts.cycles - before.cycles) / gone : null;
    const share = gone > 0 ? (facts.worked_s - before.worked_s) / gone : null;
    rates[side] = { name: facts.name, time: header.time_s, cycles: facts.cycles, worked_s: facts.worked_s, rate, share };
  }
  const { rate, share } = rates[side];
  const pace = rate === null || rate < 0 ? "" : `, ${rate.toFixed(1)} cycles/s with ${Math.round(100 * share)} % of the machine`;
  const scale = facts.scale === undefined ? rates[side].scale : facts.scale;
  rates[side].scale = scale;
  return `${facts.name}${pace}${scale ? `; ${header.overlay[side]}: ${scale}` : ""}`;
}

function table(frozen) {
  part("frozen").hidden = !frozen;
  if (!frozen) return;
  const names = [...new Set(Object.values(frozen.errors).flatMap(Object.keys))];
  const text = (value) => (value == null ? "–" : value.toPrecision(4));
  const rows = names.map((name) => {
    const row = document.createElement("tr");
    row.innerHTML = '<th scope="row"></th><td class="n"></td><td class="n"></td>';
    row.children[0].textContent = name;
    row.children[1].textContent = text((frozen.errors.left || {})[name]);
    row.children[2].textContent = text((frozen.errors.right || {})[name]);
    return row;
  });
  for (const side of ["left", "right"]) part(`${side}-name`).textContent = frozen.names[side] || side;
  part("missing").textContent = `Not taken: ${frozen.missing.join("; ")}.`;
  part("errors").replaceChildren(...rows);
}

function click(id, message) {
  part(id).addEventListener("click", () => tell(typeof message === "function" ? message() : message));
}

click("playing", () => ({ do: "playing", value: !state.animation.playing }));
click("reset", { do: "reset" });
click("freeze", () => ({ do: state.frozen ? "go_on" : "freeze" }));
click("record", { do: "record" });
click("save", { do: "save" });
part("drive").addEventListener("click", () => socket.send(JSON.stringify({ do: "drive" })));
part("scrub").addEventListener("input", (event) => tell({ do: "scrub", at_s: Number(event.target.value) }));
part("speed").addEventListener("change", (event) => tell({ do: "speed", value: Number(event.target.value) }));
part("repeats").addEventListener("change", (event) => tell({ do: "repeats", value: event.target.checked }));
part("ride").addEventListener("change", (event) => tell({ do: "ride", value: event.target.checked }));
part("strength").addEventListener("input", (event) => tell({ do: "strength", value: Number(event.target.value) }));
for (const one of document.querySelectorAll("[data-control]")) {
  one.addEventListener("change", () => {
    const now = state.controls[one.dataset.control];
    const value = one.dataset.steps ? steps(one)[Number(one.value)] : one.value;
    tell({ do: "set", name: one.dataset.control, value: typeof now === "number" ? Number(value) : value });
    if (one.tagName === "SELECT") one.blur();
  });
}
for (const one of document.querySelectorAll("[data-overlay]")) {
  one.addEventListener("change", () => {
    tell({ do: "overlay", side: one.dataset.overlay, label: one.value });
    one.blur();
  });
}
part("stage").addEventListener("keydown", (event) => {
  if (event.key === " ") {
    event.preventDefault();
    part("playing").click();
  } else if (event.key.toLowerCase() === "f" && !event.ctrlKey && !event.metaKey) {
    part("freeze").click();
  }
});
Camera.connect(tell);
connect();
