"use strict";
(() => {
  const data = JSON.parse(document.getElementById("flights").textContent);
  const place = document.getElementById("flight");
  const slider = document.getElementById("cut");
  const buttons = [...document.querySelectorAll(".controls button")];
  let shown = data.flights[data.flights.length - 1];

  // what is packed in the page: base64 of gzip
  function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
  }

  // once, when the view comes into sight
  async function load() {
    for (const flight of data.flights) {
      flight.map.index = new Int16Array(await unpacked(flight.map.index).arrayBuffer());
    }
    const script = document.createElement("script");
    script.textContent = await unpacked(document.getElementById("plotly-gz").textContent).text();
    document.head.appendChild(script);
  }

  // outer faces of the voxels below a height: two triangles where no voxel adjoins
  function surface(map, cut) {
    const count = map.index.length / 3;
    const cellOf = (n) => [map.index[n], map.index[n + count], map.index[n + 2 * count]];
    const key = (i, j, k) => (i + 1) * 1e8 + (j + 1) * 1e4 + (k + 1);
    const kept = [];
    for (let n = 0; n < count; n++) {
      const cell = cellOf(n);
      if (map.origin_m[2] + cell[2] * map.size_m <= cut) kept.push(cell);
    }
    const cells = new Set(kept.map((cell) => key(...cell)));
    const mesh = { x: [], y: [], z: [], i: [], j: [], k: [] };
    const coordinates = [mesh.x, mesh.y, mesh.z];
    for (const cell of kept) {
      for (let axis = 0; axis < 3; axis++) {
        for (const side of [-1, 1]) {
          const next = cell.slice();
          next[axis] += side;
          if (cells.has(key(...next))) continue;
          const first = mesh.x.length;
          for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
            const corner = cell.slice();
            corner[axis] += side / 2;
            corner[(axis + 1) % 3] += u / 2;
            corner[(axis + 2) % 3] += v / 2;
            coordinates.forEach((list, a) => list.push(map.origin_m[a] + corner[a] * map.size_m));
          }
          mesh.i.push(first, first);
          mesh.j.push(first + 1, first + 2);
          mesh.k.push(first + 2, first + 3);
        }
      }
    }
    return mesh;
  }

  // pale floor to dark ceiling: the path stands out, in grey print too
  const HEIGHTS = [[0, "#f4f0e8"], [0.4, "#dccba8"], [0.7, "#a8865a"], [1, "#5f4426"]];

  const along = ([x, y, z]) => ({ type: "scatter3d", x, y, z });
  const at = ([x, y, z]) => along([[x], [y], [z]]);

  function replanTraces(replans) {
    const causes = [...new Set(replans.map((replan) => replan.cause))];
    return causes.map((cause) => {
      const mine = replans.filter((replan) => replan.cause === cause);
      return {
        ...along([0, 1, 2].map((axis) => mine.map((replan) => replan.at[axis]))),
        mode: "markers", name: `replan: ${cause} (${mine.length})`, hoverinfo: "text",
        text: mine.map((replan) => replan.hover),
        marker: { color: mine[0].colour, symbol: mine[0].symbol, size: 6, line: { color: "#000", width: 1 } },
      };
    });
  }

  function moverTraces(movers) {
    if (!movers) return [];
    const mark = { color: "#cc79a7", symbol: "circle", size: 6, line: { color: "#000", width: 1 } };
    return [
      { ...along(movers.paths), mode: "lines", name: `movers (${movers.count})`, hoverinfo: "name",
        line: { color: "#cc79a7", width: 3 } },
      { ...along(movers.last), mode: "markers", name: "movers at the end", hoverinfo: "name", marker: mark },
    ];
  }

  // goals in their order, and the frontier that the flight left at the height of its start
  function searchTraces(flight) {
    const count = flight.goals[0].length, found = [];
    if (count) {
      found.push({ ...along(flight.goals), mode: "markers+text", name: `goals in their order (${count})`,
        text: flight.goals[0].map((_, n) => `${n + 1}`), textposition: "top center", hoverinfo: "text",
        textfont: { color: "#882255", size: 10 },
        marker: { color: "#ffffff", symbol: "circle", size: 5, line: { color: "#882255", width: 2 } } });
    }
    if (flight.frontier[0].length) {
      found.push({ ...along(flight.frontier), mode: "markers", name: "frontier at the end", hoverinfo: "name",
        marker: { color: "#aa4499", symbol: "circle", size: 2 } });
    }
    return found;
  }

  function traces(flight) {
    const cut = Number(slider.value);
    const mesh = surface(flight.map, cut);
    return [
      { type: "mesh3d", ...mesh, intensity: mesh.z, colorscale: HEIGHTS, cmin: data.height_m[0],
        cmax: data.height_m[1], flatshading: true, opacity: 1, hoverinfo: "skip", name: "map",
        lighting: { ambient: 0.9, diffuse: 0.5, specular: 0.05 },
        showscale: !isNarrow, colorbar: { title: { text: "height [m]" }, len: 0.5, thickness: 12 } },
      { ...along(data.shortest), mode: "lines", name: "true shortest path", hoverinfo: "skip",
        line: { color: "#888888", width: 3, dash: "dot" } },
      { ...along(flight.reference), mode: "lines", name: "reference", hoverinfo: "skip",
        line: { color: ink, width: 3, dash: "dash" } },
      { ...along(flight.flown), mode: "lines", name: "flown", hoverinfo: "text", text: flight.hover,
        line: { color: flight.colour, width: 7 } },
      ...searchTraces(flight),
      ...moverTraces(flight.movers),
      ...replanTraces(flight.replans),
      { ...along(flight.contacts), mode: "markers", name: `contact (${flight.contacts[0].length})`,
        hoverinfo: "name", marker: { color: "#d55e00", symbol: "x", size: 7 } },
      { ...at(data.start), mode: "markers", name: "start", hoverinfo: "name",
        marker: { color: "#ffffff", symbol: "circle", size: 7, line: { color: "#000", width: 2 } } },
      { ...at(data.target), mode: "markers", name: "target", hoverinfo: "name",
        marker: { color: "#f0e442", symbol: "diamond", size: 9, line: { color: "#000", width: 2 } } },
    ];
  }

  // all flights and both ends in view: the longest side of what is shown is 1, seen from slantwise above
  function sceneOf() {
    const points = [0, 1, 2].map((axis) => [
      data.start[axis], data.target[axis],
      ...data.flights.flatMap((flight) => flight.flown[axis]), ...(axis === 2 ? data.height_m : []),
    ]);
    const ranges = points.map((values, axis) => {
      const [low, high] = values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
      return axis === 2 ? [low, high] : [low - 1, high + 1];
    });
    const sizes = ranges.map(([low, high]) => high - low);
    const longest = Math.max(...sizes);
    const [x, y, z] = sizes.map((size) => size / longest);
    const narrow = Math.max(1, place.clientHeight / place.clientWidth); // an upright window sees less to the sides
    const away = 0.85 * narrow * Math.hypot(x, y, z);
    const axis = (name, range) => ({ title: { text: `${name} [m]` }, range, color: ink, gridcolor: line });
    return {
      aspectmode: "manual", aspectratio: { x, y, z },
      camera: { eye: { x: -0.1 * away, y: -0.75 * away, z: 0.95 * away }, center: { x: 0, y: 0, z: -0.15 } },
      xaxis: axis("x", ranges[0]), yaxis: axis("y", ranges[1]), zaxis: axis("z", ranges[2]),
    };
  }

  const styles = getComputedStyle(document.documentElement);
  const [ink, line, paper] = ["--ink", "--line", "--paper"].map((name) => styles.getPropertyValue(name).trim());
  const isNarrow = place.clientWidth < 600;
  const layout = {
    margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "kept", // the camera stays when the flight changes
    paper_bgcolor: paper, font: { color: ink, size: isNarrow ? 9 : 12 },
    legend: { x: 0, y: 1, bgcolor: "rgba(0,0,0,0)" },
    scene: sceneOf(),
  };

  function draw() {
    document.getElementById("cut-m").textContent = `${Number(slider.value).toFixed(1)} m`;
    document.getElementById("headline").textContent = `${shown.arm}: ${shown.headline}`;
    for (const button of buttons) {
      button.setAttribute("aria-pressed", String(button.dataset.arm === shown.arm));
    }
    if (window.Plotly) {
      window.Plotly.react(place, traces(shown), layout, { responsive: true, displaylogo: false });
    }
  }

  for (const button of buttons) {
    button.addEventListener("click", () => {
      shown = data.flights.find((flight) => flight.arm === button.dataset.arm);
      draw();
    });
  }
  slider.min = data.height_m[0];
  slider.max = data.height_m[1];
  slider.value = data.cut_m;
  slider.addEventListener("change", draw);
  draw();

  async function begin() {
    place.textContent = "unpacking the view ...";
    try {
      await load();
      place.textContent = "";
      draw();
    } catch (error) {
      place.textContent = `This browser cannot show the view (${error}); one from 2023 or later can.`;
    }
  }
  const watch = new IntersectionObserver((entries) => {
    if (entries.some((entry) => entry.isIntersecting)) {
      watch.disconnect();
      begin();
    }
  });
  watch.observe(place);
})();
