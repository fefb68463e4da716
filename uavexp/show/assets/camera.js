"use strict";
// One camera for all views: it goes round a point; drag turns, shift or right drag moves, the wheel zooms.
const camera = (() => {
  const at = { middle: [0, 0, 0], distance: 20, turn: -0.9, tilt: 0.95 };
  const FIELD = 0.75; // rad, of the lower of width and height

  function axes() {
    const [ct, st, cp, sp] = [Math.cos(at.turn), Math.sin(at.turn), Math.cos(at.tilt), Math.sin(at.tilt)];
    return { right: [-st, ct, 0], up: [-sp * ct, -sp * st, cp], back: [cp * ct, cp * st, sp] };
  }

  // column-major matrix of a canvas of this width over height
  function matrix(aspect) {
    const { right, up, back } = axes();
    const eye = at.middle.map((value, k) => value + at.distance * back[k]);
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const f = (1 / Math.tan(FIELD / 2)) * Math.min(1, aspect), near = 0.05, far = at.distance + 1000;
    const sx = f / aspect, d = (far + near) / (near - far), e = (2 * far * near) / (near - far);
    const rows = [
      [...right.map((v) => sx * v), -sx * dot(right, eye)],
      [...up.map((v) => f * v), -f * dot(up, eye)],
      [...back.map((v) => d * v), -d * dot(back, eye) + e],
      [...back.map((v) => -v), dot(back, eye)],
    ];
    return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
  }

  // pixels of a point; null behind the eye
  function pixel(view, point, width, height) {
    const row = (n) => view[n] * point[0] + view[n + 4] * point[1] + view[n + 8] * point[2] + view[n + 12];
    const w = row(3);
    return w < 0.05 ? null : [(0.5 + (0.5 * row(0)) / w) * width, (0.5 - (0.5 * row(1)) / w) * height];
  }

  // so near that every point is just in view, with some room, on canvases of these widths over heights
  function fit(points, aspects) {
    const ROOM = 0.8, { right, up, back } = axes(), f = 1 / Math.tan(FIELD / 2);
    const along = (axis, point) => axis.reduce((sum, value, k) => sum + value * (point[k] - at.middle[k]), 0);
    const ends = (values) => values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [values[0], values[0]]);
    const half = (values) => (ends(values)[0] + ends(values)[1]) / 2;
    const needed = (point, aspect) => {
      const fy = f * Math.min(1, aspect), aside = Math.max(Math.abs(along(right, point)) / aspect, Math.abs(along(up, point)));
      return along(back, point) + (fy * aside) / ROOM;
    };
    at.middle = [0, 1, 2].map((k) => half(points.map((point) => point[k])));
    for (let turn = 0; turn < 4; turn++) { // what is near looks larger: move until above and below are alike
      at.distance = Math.max(3, ...aspects.map((aspect) => ends(points.map((point) => needed(point, aspect)))[1]));
      const shift = turn < 3 ? at.distance * half(points.map((point) => along(up, point) / (at.distance - along(back, point)))) : 0;
      at.middle = at.middle.map((value, k) => value + shift * up[k]);
    }
  }

  function listen(element, redraw) {
    const fingers = new Map();
    let spread = 0;
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      element.setPointerCapture(event.pointerId);
      spread = 0;
    });
    for (const name of ["pointerup", "pointercancel"]) {
      element.addEventListener(name, (event) => fingers.delete(event.pointerId));
    }
    element.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) {
        const [a, b] = [...fingers.values()];
        const apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (spread) at.distance *= spread / apart;
        spread = apart;
      } else if (event.shiftKey || event.buttons === 2) {
        const { right, up } = axes(), scale = (at.distance * FIELD) / element.clientHeight;
        at.middle = at.middle.map((value, k) => value + scale * (dy * up[k] - dx * right[k]));
      } else {
        at.turn -= 0.006 * dx;
        at.tilt = Math.min(1.57, Math.max(0.05, at.tilt + 0.006 * dy));
      }
      redraw();
    });
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      at.distance = Math.min(2000, Math.max(0.5, at.distance * Math.exp(0.001 * event.deltaY)));
      redraw();
    }, { passive: false });
  }

  return { matrix, pixel, fit, listen };
})();
