// Shows the trials one by one: two synchronised pairs of the same sequence, one of which differs. The pairs stand side
// by side where four pictures fit into the window, else they are seen in turn, two pictures side by side.
"use strict";

const message = document.getElementById("message"), pairs = document.getElementById("pairs");
const progress = document.getElementById("progress"), canvases = [...document.querySelectorAll("canvas")];
const headers = { "X-Token": document.querySelector("meta[name=token]").content };
const columns = [...document.querySelectorAll(".pair")];
let state = null, phase = "loading", shown = null, told = 0;

const RULES = {
  4: "Two pairs of moving pictures are shown, left and right.\nIn one pair the upper and the lower picture differ.\n" +
    "Press the arrow key of the side where they differ. Guess if you cannot tell.",
  2: "Two pairs of moving pictures are shown in turn; the space key changes to the other pair.\n" +
    "In one pair the left and the right picture differ.\nPress the left arrow key if they differ in the first pair, " +
    "the right one for the second. Guess if you cannot tell.",
};

function say(text) {
  message.textContent = text;
  message.style.display = "grid";
  pairs.style.display = "none";
}

// Frames of the stimuli of a trial, decoded; each stimulus is fetched once.
async function frames(trial) {
  const numbers = [...trial.left, ...trial.right], decoded = new Map();
  for (const number of new Set(numbers)) {
    const list = [...Array(trial.frames).keys()].map(async (frame) => {
      const answer = await fetch(`frame/${number}/${frame}`, { headers });
      if (!answer.ok) throw new Error(await answer.text());
      return createImageBitmap(await answer.blob());
    });
    decoded.set(number, await Promise.all(list));
  }
  return numbers.map((number) => decoded.get(number));
}

// One pixel of the picture is one pixel of the screen, whatever the zoom of the browser.
function fit([width, height]) {
  const ratio = window.devicePixelRatio || 1;
  for (const canvas of canvases) {
    canvas.width = width, canvas.height = height;
    canvas.style.width = `${width / ratio}px`, canvas.style.height = `${height / ratio}px`;
  }
}

// The number of pictures that fit into the window at once: 4, 2 or 0.
function fitting([width, height]) {
  const ratio = window.devicePixelRatio || 1, wide = 2 * width / ratio, high = height / ratio;
  if (wide + 48 <= window.innerWidth && 2 * high + 24 <= window.innerHeight) return 4;
  return wide + 8 <= window.innerWidth && high + 16 <= window.innerHeight ? 2 : 0;
}

// Shows both pairs, or one of them.
function reveal(videos, pair) {
  pairs.className = videos === 2 ? "turns" : "";
  columns.forEach((column, at) => { column.style.display = videos === 2 && at !== pair ? "none" : "grid"; });
  if (videos === 2) progress.textContent = `${state.done} of ${state.total}, ${pair ? "second" : "first"} pair`;
  shown.pair = pair;
  shown.seen.add(pair);
}

// All four canvases are drawn in the same refresh. Counts refreshes, and late ones.
function play(sequences, rate) {
  const contexts = canvases.map((canvas) => canvas.getContext("2d"));
  const run = { begun: performance.now(), intervals: [], last: null, over: false, videos: 4, pair: 0, seen: new Set() };
  function draw(now) {
    if (run.over) return;
    if (run.last !== null) run.intervals.push(now - run.last);
    run.last = now;
    const frame = Math.max(0, Math.floor((now - run.begun) * rate / 1000)) % sequences[0].length;
    contexts.forEach((context, at) => context.drawImage(sequences[at][frame], 0, 0));
    requestAnimationFrame(draw);
  }
  requestAnimationFrame(draw);
  return run;
}

function measured(run) {
  const sorted = [...run.intervals].sort((a, b) => a - b), middle = sorted[Math.floor(sorted.length / 2)] || 0;
  const box = pairs.getBoundingClientRect();
  return {
    response_s: (performance.now() - run.begun) / 1000,
    display_rate_hz: middle > 0 ? 1000 / middle : 0,
    dropped_frames: run.intervals.filter((interval) => interval > 1.5 * middle).length,
    refreshes: run.intervals.length,
    fits_window: pairs.scrollWidth <= window.innerWidth && box.bottom <= window.innerHeight,
    device_pixel_ratio: window.devicePixelRatio || 1,
    videos: run.videos,
  };
}

async function next() {
  progress.textContent = `${state.done} of ${state.total}`;
  if (state.trial === null) {
    phase = "end";
    say("That was the last one. Thank you.");
    return;
  }
  const videos = fitting(state.size_px), [width, height] = state.size_px;
  if (videos === 0) {
    phase = "small";
    const ratio = window.devicePixelRatio || 1, wide = Math.ceil(2 * width / ratio + 8);
    say(`The window is too small for two pictures side by side.\nIt has ${window.innerWidth} x ${window.innerHeight} ` +
      `and needs ${wide} x ${Math.ceil(height / ratio + 16)}. Make it larger, or the zoom smaller.`);
    return;
  }
  if (videos !== told) {
    told = videos;
    pause(RULES[videos]);
    return;
  }
  phase = "loading";
  say("Loading …");
  let sequences;
  try {
    sequences = await frames(state.trial);
  } catch (error) {
    pause(`The pictures cannot be shown: ${error.message}`);
    return;
  }
  fit(state.size_px);
  message.style.display = "none";
  pairs.style.display = "flex";
  shown = play(sequences, state.frame_rate_hz);
  shown.videos = videos;
  reveal(videos, 0);
  phase = "trial";
}

function pause(text) {
  phase = "pause";
  say(`${text}\nPress space to continue.`);
}

async function answer(side) {
  phase = "sending";
  const facts = measured(shown);
  shown.over = true;
  const body = JSON.stringify({ trial: state.trial.number, answer: side, ...facts });
  // the next trial is shown only once this one is on disk; if the server is gone, the page waits for it
  for (;;) {
    try {
      const reply = await fetch("answer", { method: "POST", body, headers });
      if (reply.status < 500) {
        state = await (reply.ok ? reply : await fetch("state", { headers })).json();
        break;
      }
      say(`The answer cannot be stored: ${await reply.text()}Waiting …`);
    } catch {
      say("The server does not answer. Waiting …");
    }
    await new Promise((resolve) => setTimeout(resolve, 300));
  }
  const slow = Math.abs(facts.display_rate_hz / state.frame_rate_hz - Math.round(facts.display_rate_hz / state.frame_rate_hz)) > 0.1;
  progress.title = slow ? `display ${facts.display_rate_hz.toFixed(1)} Hz` : "";
  if (state.rest) pause("Time for a break.");
  else await next();
}

// The window became large enough.
window.addEventListener("resize", () => { if (phase === "small") next(); });

document.addEventListener("keydown", (event) => {
  const ready = phase === "trial" && (shown.videos === 4 || shown.seen.size === 2);
  if (phase === "pause" && event.code === "Space") next();
  else if (phase === "trial" && shown.videos === 2 && event.code === "Space") reveal(2, 1 - shown.pair);
  else if (ready && event.code === "ArrowLeft") answer("left");
  else if (ready && event.code === "ArrowRight") answer("right");
  else return;
  event.preventDefault();
});

(async () => {
  state = await (await fetch("state", { headers })).json();
  progress.textContent = `${state.done} of ${state.total}`;
  await next();
})();
