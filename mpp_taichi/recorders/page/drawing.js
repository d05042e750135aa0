// From a frame of the run to triangles: spheres and lines as instances of one square each.

const REFERENCE_ROWS = 720;  // of the picture that widths of lines are told for
const TRAIL_WIDTH = 1.5;  // pixels of it
const MOST_PIXELS_PER_POINT = 2;  // finer screens are drawn at this

/** Instances of a square: a program with its attributes, of which `layout` gives the number of components. */
class Instances {
  constructor(gl, vertex, fragment, corners, layout) {
    this.gl = gl;
    this.program = this.link(vertex, fragment);
    this.stride = layout.reduce((total, [, size]) => total + size, 0);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STATIC_DRAW);
    this.point("corner", 2, 0, 0, 0);
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    let offset = 0;
    for (const [name, size] of layout) {
      this.point(name, size, 4 * this.stride, 4 * offset, 1);
      offset += size;
    }
    this.data = new Float32Array(0);
    this.count = 0;
  }

  link(vertex, fragment) {
    const { gl } = this, program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  point(name, size, stride, offset, divisor) {
    const { gl } = this, place = gl.getAttribLocation(this.program, name);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
    gl.vertexAttribDivisor(place, divisor);
  }

  /** Make room for so many instances and begin anew; the caller writes `data` and counts. */
  begin(most) {
    if (this.data.length < most * this.stride) this.data = new Float32Array(most * this.stride);
    this.count = 0;
  }

  draw(uniforms) {
    const { gl } = this;
    if (!this.count) return;
    gl.useProgram(this.program);
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.data.subarray(0, this.count * this.stride), gl.DYNAMIC_DRAW);
    const place = (name) => gl.getUniformLocation(this.program, name);
    gl.uniform2f(place("halfSize"), ...uniforms.halfSize);
    gl.uniform1f(place("focal"), uniforms.focal);
    gl.uniform1i(place("orthographic"), uniforms.orthographic);
    gl.uniform1i(place("smoothed"), uniforms.smoothed);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
  }
}

/** Draws frames of a run into a canvas. Throws where the browser has no WebGL 2. */
class Drawing {
  constructor(canvas, run) {
    this.canvas = canvas;
    this.run = run;
    this.view = run.header.view;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("WebGL 2 is not available");
    this.gl = gl;
    this.prepare();
    this.seen = new Float64Array(3 * run.count);  // particles: right, up, depth [camera distances]
    this.size = new Float64Array(run.count);  // radii as drawn, 0 for what is not there
    const { color } = run.columns;
    this.color = (frame, particle, k) => color.value(frame, 3 * particle + k);
  }

  /** What the card holds; once more after it has lost it. */
  prepare() {
    const { gl } = this;
    const square = [0, 0, 1, 0, 0, 1, 1, 1], strip = [0, -1, 1, -1, 0, 1, 1, 1];
    this.spheres = new Instances(gl, SPHERE_VERTEX, SPHERE_FRAGMENT, square, [["center", 3], ["radius", 1], ["color", 3]]);
    this.lines = new Instances(gl, LINE_VERTEX, LINE_FRAGMENT, strip, [["first", 3], ["second", 3], ["color", 3], ["width", 1]]);
    this.smoothed = gl.getParameter(gl.SAMPLES) > 1;
    gl.enable(gl.DEPTH_TEST);
    if (this.smoothed) gl.enable(gl.SAMPLE_ALPHA_TO_COVERAGE);
  }

  /** Draw a frame as a camera sees it, with trails of so many frames. */
  draw(frame, camera, trails) {
    const { gl, canvas, view } = this, ratio = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_PER_POINT);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const focal = camera.focal(width, height);
    this.lineScale = camera.rows(width, height) / REFERENCE_ROWS;
    this.place(frame, camera, focal / ratio);
    this.writeSpheres(frame);
    this.writeLines(frame, camera, Math.min(trails, frame));
    gl.viewport(0, 0, width, height);
    gl.clearColor(...view.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const uniforms = { halfSize: [width / 2, height / 2], focal, orthographic: camera.orthographic, smoothed: this.smoothed };
    this.lines.draw(uniforms);
    this.spheres.draw(uniforms);
  }

  /** Where the particles are seen and how large they are drawn: scaled, and never below so many points. */
  place(frame, camera, focal) {
    const { x, y, z, radius } = this.run.columns, see = camera.viewer(), { seen, size, view } = this;
    for (let i = 0; i < this.run.count; i++) {
      see(x.value(frame, i), y.value(frame, i), z.value(frame, i), seen, 3 * i);
      const depth = seen[3 * i + 2], least = view.minimumPixels * (camera.orthographic ? 1 : Math.max(depth, 0)) / focal;
      const drawn = Math.max(radius.value(frame, i) * view.radiusScale / camera.distance, least);
      const inside = !camera.orthographic && Math.hypot(seen[3 * i], seen[3 * i + 1], depth) <= drawn * (1 + 1e-6);
      size[i] = Number.isFinite(depth) && !inside ? drawn : 0;
    }
  }

  writeSpheres(frame) {
    const { spheres, seen, size } = this;
    spheres.begin(this.run.count);
    const { data } = spheres;
    let n = 0;
    for (let i = 0; i < this.run.count; i++) {
      if (size[i] === 0) continue;
      data[n] = seen[3 * i];
      data[n + 1] = seen[3 * i + 1];
      data[n + 2] = seen[3 * i + 2];
      data[n + 3] = size[i];
      for (let k = 0; k < 3; k++) data[n + 4 + k] = this.color(frame, i, k);
      n += 7;
    }
    spheres.count = n / 7;
  }

  writeLines(frame, camera, trails) {
    const { lines, run } = this, springs = run.springsAt(frame), walls = run.columns.walls.entries / 6;
    lines.begin(springs.count + walls + trails * run.count);
    this.writeSprings(frame, springs);
    this.writeWalls(frame, camera, walls);
    if (trails > 0) this.writeTrails(frame, camera, trails);
  }

  /** One line; ends are taken from two arrays of coordinates, and left out where they are not numbers. */
  writeLine(a, i, b, j, red, green, blue, width) {
    const { lines } = this, { data } = lines, n = lines.count * lines.stride;
    if (!(Number.isFinite(a[i]) && Number.isFinite(b[j]))) return;
    for (let k = 0; k < 3; k++) {
      data[n + k] = a[i + k];
      data[n + 3 + k] = b[j + k];
    }
    data[n + 6] = red;
    data[n + 7] = green;
    data[n + 8] = blue;
    data[n + 9] = width * this.lineScale;
    lines.count++;
  }

  writeSprings(frame, { first, count, between, color }) {
    const at = frame - first;
    for (let s = 0; s < count; s++) {
      const shade = [0, 1, 2].map((k) => color.value(at, 3 * s + k));
      this.writeLine(this.seen, 3 * between[2 * s], this.seen, 3 * between[2 * s + 1], ...shade, this.view.springWidth);
    }
  }

  writeWalls(frame, camera, count) {
    const { walls } = this.run.columns, see = camera.viewer(), ends = new Float64Array(6);
    for (let w = 0; w < count; w++) {
      for (const k of [0, 3]) {
        see(walls.value(frame, 6 * w + k), walls.value(frame, 6 * w + k + 1), walls.value(frame, 6 * w + k + 2), ends, k);
      }
      this.writeLine(ends, 0, ends, 3, ...this.view.wallColor, this.view.wallWidth);
    }
  }

  /** The last places of every particle, which fade into the background and become thinner. */
  writeTrails(frame, camera, length) {
    const { run, view } = this, { x, y, z } = run.columns, see = camera.viewer(), whole = view.trails;
    let newer = this.seen, older = new Float64Array(3 * run.count);
    for (let age = 0; age < length; age++) {
      const then = frame - age - 1, strength = 1 - (age + 0.5) / whole, width = TRAIL_WIDTH * (1 - 0.5 * (age + 1) / whole);
      for (let i = 0; i < run.count; i++) {
        see(x.value(then, i), y.value(then, i), z.value(then, i), older, 3 * i);
        const shade = (k) => view.background[k] + strength * (this.color(frame, i, k) - view.background[k]);
        this.writeLine(newer, 3 * i, older, 3 * i, shade(0), shade(1), shade(2), width);
      }
      [newer, older] = [older, newer === this.seen ? new Float64Array(3 * run.count) : newer];
    }
  }

  /** The particle under a point of the page, or −1: the nearest whose disc, at least so many points wide, holds it. */
  pick(left, top, camera, tolerance = 5) {
    const { clientWidth: width, clientHeight: height } = this.canvas, focal = camera.focal(width, height);
    let best = -1, bestDepth = Infinity;
    for (let i = 0; i < this.run.count; i++) {
      const spot = this.spot(i, camera, focal, width, height);
      if (!spot) continue;
      const distance = Math.hypot(left - spot.left, top - spot.top);
      if (distance > Math.max(spot.radius, tolerance)) continue;
      // A disc that really is hit comes before one that is merely near.
      const depth = distance <= spot.radius ? this.seen[3 * i + 2] - this.size[i] : 1e12 * (1 + distance);
      if (depth < bestDepth) [best, bestDepth] = [i, depth];
    }
    return best;
  }

  /** Where a particle of the frame last drawn is on the page and how large, or null: { left, top, radius } in points. */
  spot(i, camera, focal, width, height) {
    const depth = this.seen[3 * i + 2];
    if (this.size[i] === 0 || (!camera.orthographic && depth <= 0)) return null;
    const scale = camera.orthographic ? focal : focal / depth;
    return {
      left: width / 2 + this.seen[3 * i] * scale,
      top: height / 2 - this.seen[3 * i + 1] * scale,
      radius: this.size[i] * scale,
    };
  }
}
