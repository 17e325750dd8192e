"use strict";
// Mouse, touch and keys drive the camera.
const Camera = (() => {
  const stage = document.getElementById("stage");
  const GOES = { w: ["ahead", 1], s: ["ahead", -1], d: ["right", 1], a: ["right", -1], e: ["up", 1], q: ["up", -1] };
  const TURNS = {
    ArrowLeft: ["turn_left", 1], ArrowRight: ["turn_left", -1], ArrowUp: ["turn_up", 1], ArrowDown: ["turn_up", -1],
  };
  const PACE = 0.35; // distances to what is looked at, a second
  const TURN = 0.7; // radians a second
  const DRAG = 2.2; // radians across the stage
  const down = new Set();
  let tell = () => {};
  let waiting = null;

  function go() {
    const asked = { right: 0, up: 0, ahead: 0, turn_left: 0, turn_up: 0 };
    for (const key of down) {
      const [name, sign] = GOES[key] || TURNS[key];
      asked[name] += sign * (GOES[key] ? PACE : TURN);
    }
    tell({ do: "go", ...asked });
  }

  function known(event) {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    return key in GOES || key in TURNS ? key : null;
  }

  stage.addEventListener("keydown", (event) => {
    const key = known(event);
    if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (!down.has(key)) {
      down.add(key);
      go();
    }
  });
  window.addEventListener("keyup", (event) => {
    const key = known(event);
    if (key && down.delete(key)) go();
  });
  function release() {
    if (down.size) {
      down.clear();
      go();
    }
  }
  stage.addEventListener("blur", release);
  window.addEventListener("blur", release);

  // Movements between two frames are told together.
  function turn(left, up, orbit) {
    if (!waiting) {
      waiting = { do: "turn", left: 0, up: 0, orbit };
      requestAnimationFrame(() => {
        tell(waiting);
        waiting = null;
      });
    }
    waiting.left += left;
    waiting.up += up;
  }

  stage.addEventListener("pointerdown", (event) => {
    stage.focus();
    stage.setPointerCapture(event.pointerId);
  });
  stage.addEventListener("pointermove", (event) => {
    if (!stage.hasPointerCapture(event.pointerId)) return;
    const scale = DRAG / stage.clientWidth;
    const orbit = event.shiftKey || (event.buttons & 2) !== 0;
    // the scene follows the hand; round a point the camera goes the other way
    const sign = orbit ? -1 : 1;
    turn(sign * event.movementX * scale, sign * event.movementY * scale, orbit);
  });
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    tell({ do: "step", ahead: -Math.sign(event.deltaY) * 0.05 });
  }, { passive: false });

  return { connect(to) { tell = to; } };
})();
