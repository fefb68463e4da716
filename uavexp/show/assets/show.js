"use strict";
(async () => {
  const data = JSON.parse(document.getElementById("flights").textContent);
  const byId = (name) => document.getElementById(name);
  const [play, time, speed, cut] = ["play", "time", "speed", "cut"].map(byId);
  const BLUE = "#0072B2", RED = "#D55E00", WINE = "#882255", PURPLE = "#AA4499";
  let now = data.end_s, playing = false, asked = false;

  async function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Int16Array(await new Response(stream).arrayBuffer());
  }

  // last row whose time is not after `at`
  function rowAt(times, at) {
    let low = 0, high = times.length;
    while (low + 1 < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= at) low = middle; else high = middle;
    }
    return low;
  }
  const pointAt = (flat, n) => [flat[3 * n], flat[3 * n + 1], flat[3 * n + 2]];

  function element(parent, tag, name, text) {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  }

  // height as colour, from dark to light
  function heightColour(share) {
    return [0.36 + 0.42 * share, 0.45 + 0.33 * share, 0.55 + 0.2 * share, 1];
  }

  async function voxelRows(map) {
    const values = await unpacked(map.voxels), count = values.length / 4, rows = new Float32Array(11 * count);
    let top = 1;
    for (let n = 0; n < count; n++) top = Math.max(top, values[2 * count + n]);
    for (let n = 0; n < count; n++) {
      const middle = [0, 1, 2].map((k) => map.origin_m[k] + values[k * count + n] * map.size_m);
      const half = 0.48 * map.size_m;
      rows.set([...middle, half, half, half, ...heightColour(values[2 * count + n] / top), values[3 * count + n] / 10], 11 * n);
    }
    return rows;
  }

  async function makeView(flight) {
    const box = element(byId("views"), "section", "view");
    if (data.flights.length > 1) element(box, "h2", "", flight.label);
    element(box, "p", "headline", flight.headline);
    const words = element(box, "p", "now");
    const scene = element(box, "div", "scene"), strip = element(box, "div", "strip");
    const solid = element(scene, "canvas"), flat = element(scene, "canvas"), graph = element(strip, "canvas");
    const painter = solids.painter(solid);
    const made = { flight, words, scene, solid, flat, strip, graph, painter };
    if (painter) {
      made.voxels = painter.instances(2);
      made.voxels.fill(await voxelRows(flight.map));
      made.bodies = [0, 1, 2].map((mesh) => painter.instances(mesh));
    }
    camera.listen(scene, redraw);
    strip.addEventListener("pointerdown", (event) => {
      const bounds = strip.getBoundingClientRect();
      setTime((data.end_s * (event.clientX - bounds.left)) / bounds.width);
    });
    return made;
  }

  function sized(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    return { width, height, ratio };
  }

  function drawSolids(view, matrix, row) {
    const { flight, painter, bodies } = view;
    if (!painter) return;
    const lists = [[], [], []], { movers } = flight;
    if (movers.shape.length) {
      movers.at[rowAt(movers.time_s, now)].forEach((place, n) => {
        if (place) lists[movers.shape[n]].push(...place, ...movers.half_m[n], 0.53, 0.13, 0.33, 1, -1);
      });
    }
    const vehicle = pointAt(flight.path, row);
    lists[1].push(...vehicle, flight.radius_m, flight.radius_m, 0.06, 0, 0.45, 0.7, 1, -1);
    painter.begin(matrix);
    painter.show(now, Number(cut.value));
    view.voxels.draw();
    painter.show(now, Infinity); // what moves is never cut
    lists.forEach((list, mesh) => { bodies[mesh].fill(new Float32Array(list)); bodies[mesh].draw(); });
  }

  function line(pen, points, colour, width, dash) {
    pen.beginPath();
    for (const point of points) if (point) pen.lineTo(...point);
    pen.setLineDash(dash || []);
    pen.lineWidth = width;
    pen.strokeStyle = colour;
    pen.stroke();
    pen.setLineDash([]);
  }

  function label(pen, point, text) {
    pen.font = "600 12px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = "rgba(255,255,255,0.9)";
    pen.strokeText(text, point[0] + 12, point[1] - 8);
    pen.fillStyle = "#111";
    pen.fillText(text, point[0] + 12, point[1] - 8);
  }

  // goals so far, the last with a line to where it was chosen, and the frontier that the flight left
  function drawSearch(pen, flight, taken, seen) {
    const goals = taken.filter((plan) => plan.goal);
    for (const plan of goals) {
      const last = plan === taken[taken.length - 1], goal = seen(plan.goal);
      if (!goal) continue;
      pen.globalAlpha = last ? 1 : 0.45;
      if (last) line(pen, [seen(plan.at), goal], WINE, 1.2, [2, 4]);
      marks.draw(pen, ...goal, last ? 7 : 4, "o", "#fff", WINE);
      pen.globalAlpha = 1;
    }
    if (now < flight.time_s[flight.time_s.length - 1]) return;
    pen.fillStyle = PURPLE;
    for (let n = 0; n < flight.frontier.length / 3; n++) {
      const cell = seen(pointAt(flight.frontier, n));
      if (cell) pen.fillRect(cell[0] - 1, cell[1] - 1, 2.5, 2.5);
    }
  }

  function drawLines(view, matrix, row) {
    const { flight, flat } = view, { width, height, ratio } = sized(flat), pen = flat.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineJoin = pen.lineCap = "round";
    const seen = (point) => camera.pixel(matrix, point, width, height);
    const flown = [];
    for (let n = 0; n <= row; n++) flown.push(seen(pointAt(flight.path, n)));
    const taken = flight.plans.filter((plan) => plan.points.length && plan.from_s !== null && plan.from_s <= now);
    for (const plan of taken) {
      const last = plan === taken[taken.length - 1], points = [];
      for (let n = 0; n < plan.points.length / 3; n++) points.push(seen(pointAt(plan.points, n)));
      const colour = data.causes[plan.cause].colour;
      if (last) line(pen, points, "#fff", 4.5);
      pen.globalAlpha = last ? 1 : 0.3;
      line(pen, points, colour, last ? 2.5 : 1, last ? [7, 5] : []);
      pen.globalAlpha = 1;
    }
    drawSearch(pen, flight, taken, seen);
    line(pen, flown, "#fff", 5.5);
    line(pen, flown, BLUE, 3);
    const many = flight.plans.length > 40;
    for (const plan of flight.plans) {
      const point = plan.s <= now && seen(plan.at), cause = data.causes[plan.cause];
      if (point) marks.draw(pen, ...point, many ? 5 : 7.5, cause.marker, plan.points.length ? cause.colour : "#fff", plan.points.length ? "#fff" : cause.colour);
    }
    for (const contact of flight.contacts) {
      const point = contact.s <= now && seen(contact.at);
      if (point) marks.draw(pen, ...point, 10, "X", RED, "#000");
    }
    const start = seen(data.start), target = data.target && seen(data.target), vehicle = seen(pointAt(flight.path, row));
    if (start) { marks.draw(pen, ...start, 7, "o", "#fff", "#000"); label(pen, start, "start"); }
    if (target) { marks.draw(pen, ...target, 12, "*", "#F0E442", "#000"); label(pen, target, "target"); }
    if (vehicle) {
      const yaw = flight.yaw[row], place = pointAt(flight.path, row);
      const nose = seen([place[0] + 0.7 * Math.cos(yaw), place[1] + 0.7 * Math.sin(yaw), place[2]]);
      if (nose) line(pen, [vehicle, nose], "#000", 2);
      marks.draw(pen, ...vehicle, 7, "o", BLUE, "#000");
      if (now < data.end_s) label(pen, vehicle, "vehicle");
    }
  }

  // clearance over time, with the replans on its upper edge
  function drawStrip(view) {
    const { flight, graph } = view, { width, height, ratio } = sized(graph), pen = graph.getContext("2d");
    const ink = getComputedStyle(document.body).color, top = Math.max(1, ...flight.clearance_m);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const x = (s) => (width * s) / data.end_s, y = (m) => height - 4 - ((height - 34) * Math.max(0, m)) / top;
    const points = flight.time_s.map((s, n) => [x(s), y(flight.clearance_m[n])]);
    pen.globalAlpha = 0.3;
    line(pen, points, BLUE, 1.5);
    pen.globalAlpha = 1;
    line(pen, points.slice(0, rowAt(flight.time_s, now) + 1), BLUE, 2);
    for (const plan of flight.plans) {
      const cause = data.causes[plan.cause];
      pen.globalAlpha = plan.s <= now ? 1 : 0.3;
      marks.draw(pen, Math.min(width - 6, Math.max(6, x(plan.s))), 24, 5, cause.marker, cause.colour);
    }
    pen.globalAlpha = 1;
    line(pen, [[x(now), 16], [x(now), height]], ink, 1);
    pen.fillStyle = ink;
    pen.font = "11px system-ui, sans-serif";
    const row = rowAt(flight.time_s, now);
    pen.fillText(`clearance to the nearest obstacle: ${flight.clearance_m[row].toFixed(2)} m (drawn from 0 to ${top.toFixed(1)} m)`, 6, 12);
  }

  function drawWords(view) {
    const done = view.flight.plans.filter((plan) => plan.s <= now), last = done[done.length - 1];
    view.words.textContent = last ? `${last.s.toFixed(1)} s · ${last.words}` : "before the first plan";
  }

  function draw() {
    asked = false;
    for (const view of views) {
      const { width, height } = sized(view.solid), row = rowAt(view.flight.time_s, now);
      const matrix = camera.matrix(width / Math.max(1, height));
      drawSolids(view, matrix, row);
      drawLines(view, matrix, row);
      drawStrip(view);
      drawWords(view);
    }
    time.value = now;
    byId("time-s").textContent = `${now.toFixed(1)} of ${data.end_s.toFixed(1)} s`;
    byId("cut-m").textContent = `${Number(cut.value).toFixed(1)} m`;
    play.textContent = playing ? "❚❚ Pause" : "▶ Play";
  }
  function redraw() {
    if (!asked) requestAnimationFrame(draw);
    asked = true;
  }
  function setTime(at) {
    now = Math.min(data.end_s, Math.max(0, at));
    redraw();
  }

  function run(before) {
    requestAnimationFrame((stamp) => {
      if (!playing) return;
      now = Math.min(data.end_s, now + (Number(speed.value) * (stamp - before)) / 1000);
      playing = now < data.end_s;
      draw();
      run(stamp);
    });
  }
  function toggle() {
    playing = !playing;
    if (playing && now >= data.end_s) now = 0;
    draw();
    if (playing) run(performance.now());
  }

  function legend() {
    const box = byId("legend");
    const entry = (text, sketch) => {
      const item = element(box, "span"), canvas = element(item, "canvas");
      canvas.width = canvas.height = 20;
      sketch(canvas.getContext("2d"));
      item.append(text);
    };
    entry("flown", (pen) => line(pen, [[1, 10], [19, 10]], BLUE, 3));
    entry("plan being flown, in the colour of its cause", (pen) => line(pen, [[0, 10], [20, 10]], "#606060", 2.5, [6, 4]));
    entry("mapped as occupied, lighter is higher", (pen) => { pen.fillStyle = "#8a9aac"; pen.fillRect(3, 3, 14, 14); });
    if (data.flights.some((flight) => flight.plans.some((plan) => plan.goal))) {
      entry("goal short of the target, the last with a line to where it was chosen", (pen) => marks.draw(pen, 10, 10, 7, "o", "#fff", WINE));
    }
    if (data.flights.some((flight) => flight.frontier.length)) {
      entry("frontier at the end, at the height of the start", (pen) => { pen.fillStyle = PURPLE; pen.fillRect(8, 8, 4, 4); });
    }
    if (data.flights.some((flight) => flight.movers.shape.length)) {
      entry("moving obstacle", (pen) => marks.draw(pen, 10, 10, 8, "o", "#882255"));
    }
    if (data.flights.some((flight) => flight.contacts.length)) {
      entry("contact", (pen) => marks.draw(pen, 10, 10, 9, "X", RED, "#000"));
    }
    for (const [name, cause] of Object.entries(data.causes)) {
      entry(`replanned: ${name}, ${cause.label}`, (pen) => marks.draw(pen, 10, 10, 8, cause.marker, cause.colour, "#888"));
    }
  }

  cut.max = Math.max(...data.flights.map((flight) => flight.map.top_m));
  cut.min = Math.min(...data.flights.map((flight) => flight.map.origin_m[2]));
  cut.value = data.cut_m;
  time.max = data.end_s;
  const views = [];
  for (const flight of data.flights) views.push(await makeView(flight));
  const points = data.target ? [data.target] : [];
  for (const { path } of data.flights) for (let n = 0; n < path.length; n += 3) points.push(path.slice(n, n + 3));
  camera.fit(points, views.map(({ scene }) => scene.clientWidth / scene.clientHeight));
  legend();
  if (views.some((view) => !view.painter)) byId("no-webgl").hidden = false;
  play.addEventListener("click", toggle);
  time.addEventListener("input", () => { playing = false; setTime(Number(time.value)); });
  cut.addEventListener("input", redraw);
  window.addEventListener("resize", redraw);
  document.addEventListener("keydown", (event) => {
    if (event.key === " " && event.target === document.body) { event.preventDefault(); toggle(); }
  });
  const wanted = new URLSearchParams(location.hash.slice(1)).get("t");
  if (wanted !== null) now = Math.min(data.end_s, Number(wanted) || 0);
  draw();
  document.body.dataset.ready = "yes";
})();
