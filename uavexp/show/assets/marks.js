"use strict";
// Marks of causes on a 2D canvas, by the letter that matplotlib has for them.
const marks = (() => {
  const polygons = { "^": [3, -90], v: [3, 90], "<": [3, 180], ">": [3, 0], s: [4, 45], D: [4, 0], d: [4, 0],
    p: [5, -90], h: [6, -90], H: [6, 0], 8: [8, 22.5], o: [24, 0] };
  const stars = { "*": [5, -90, 0.45], X: [4, 45, 0.4], P: [4, 0, 0.4] };

  function outline(marker) {
    const [sides, turn, inner] = stars[marker] || [...(polygons[marker] || polygons.d), 1];
    const points = [];
    for (let n = 0; n < 2 * sides; n++) {
      if (n % 2 && inner === 1) continue;
      const angle = ((turn + (180 * n) / sides) * Math.PI) / 180;
      const radius = n % 2 ? inner : 1;
      points.push([radius * Math.cos(angle), radius * Math.sin(angle)]);
    }
    return points;
  }

  function draw(pen, x, y, size, marker, colour, edge = "#fff") {
    pen.beginPath();
    for (const [u, v] of outline(marker)) pen.lineTo(x + size * u, y + size * v);
    pen.closePath();
    pen.fillStyle = colour;
    pen.strokeStyle = edge;
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.fill();
  }

  return { draw };
})();
