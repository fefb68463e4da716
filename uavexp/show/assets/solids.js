"use strict";
// Voxels, movers and the vehicle: instances of small meshes, drawn by WebGL 2.
const solids = (() => {
  const VERTEX = `#version 300 es
  in vec3 corner; in vec3 normal; in vec3 middle; in vec3 half_size; in vec4 colour; in float since;
  uniform mat4 view; uniform float now; uniform float cut;
  out vec4 shade;
  void main() {
    bool shown = since <= now && middle.z <= cut;
    gl_Position = shown ? view * vec4(middle + corner * half_size, 1.0) : vec4(2.0, 2.0, 2.0, 0.0);
    float light = 0.62 + 0.38 * dot(normalize(normal / half_size), normalize(vec3(0.35, 0.2, 0.9)));
    shade = vec4(colour.rgb * light, colour.a);
  }`;
  const FRAGMENT = `#version 300 es
  precision mediump float; in vec4 shade; out vec4 colour;
  void main() { colour = shade; }`;

  // triangles of a surface given by its rings of (radius, height), `sides` corners each
  function turned(rings, sides, offset) {
    const out = [];
    const at = ([radius, height], n) => {
      const angle = (2 * Math.PI * (n + offset)) / sides;
      return [radius * Math.cos(angle), radius * Math.sin(angle), height];
    };
    for (let r = 0; r + 1 < rings.length; r++) {
      for (let n = 0; n < sides; n++) {
        const [a, b, c, d] = [at(rings[r], n), at(rings[r], n + 1), at(rings[r + 1], n + 1), at(rings[r + 1], n)];
        out.push(a, b, c, a, c, d);
      }
    }
    const flat = [];
    for (let t = 0; t < out.length; t += 3) {
      const [a, b, c] = [out[t], out[t + 1], out[t + 2]];
      const u = b.map((value, k) => value - a[k]), v = c.map((value, k) => value - a[k]);
      let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const length = Math.hypot(...normal);
      if (length < 1e-9) continue;
      normal = normal.map((value) => value / length);
      for (const point of [a, b, c]) flat.push(...point, ...normal);
    }
    return new Float32Array(flat);
  }

  const arc = [...Array(9).keys()].map((n) => (n / 8 - 0.5) * Math.PI);
  const meshes = [
    turned(arc.map((angle) => [Math.cos(angle), Math.sin(angle)]), 16, 0), // as `Shape`: 0 a sphere,
    turned([[0, -1], [1, -1], [1, 1], [0, 1]], 20, 0), // 1 a cylinder,
    turned([[0, -1], [Math.SQRT2, -1], [Math.SQRT2, 1], [0, 1]], 4, 0.5), // 2 a box
  ];
  const ROW = 11; // middle, half size, colour, since

  function painter(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) return null;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    const uniform = (name) => gl.getUniformLocation(program, name);
    const places = { view: uniform("view"), now: uniform("now"), cut: uniform("cut") };

    function attributes(names, stride, each) {
      let offset = 0;
      for (const [name, size] of names) {
        const place = gl.getAttribLocation(program, name);
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * stride, 4 * offset);
        gl.vertexAttribDivisor(place, each);
        offset += size;
      }
    }

    // instances of a mesh; `fill` replaces their rows
    function instances(mesh) {
      const array = gl.createVertexArray(), rows = gl.createBuffer();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, meshes[mesh], gl.STATIC_DRAW);
      attributes([["corner", 3], ["normal", 3]], 6, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, rows);
      attributes([["middle", 3], ["half_size", 3], ["colour", 4], ["since", 1]], ROW, 1);
      let count = 0;
      return {
        fill(values) {
          gl.bindBuffer(gl.ARRAY_BUFFER, rows);
          gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
          count = values.length / ROW;
        },
        draw() {
          gl.bindVertexArray(array);
          gl.drawArraysInstanced(gl.TRIANGLES, 0, meshes[mesh].length / 6, count);
        },
      };
    }

    function begin(view) {
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.uniformMatrix4fv(places.view, false, view);
    }
    function show(now, cut) {
      gl.uniform1f(places.now, now);
      gl.uniform1f(places.cut, Math.min(cut, 1e9));
    }
    return { instances, begin, show };
  }

  return { painter };
})();
