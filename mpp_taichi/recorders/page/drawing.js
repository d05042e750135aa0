// From a frame of the run to triangles: spheres and lines as one square each.

const REFERENCE_ROWS = 720;  // of the picture that widths of lines are told for
const TRAIL_WIDTH = 1.5;  // pixels of it
const SQUARES_PER_ROW = 512;  // of the texture that holds their numbers: with three texels each narrower than any card allows
const MOST_PARTICLES = 2 ** 21;  // with 32 bits of depth all that a number holds exactly
const MOST_PIXELS_PER_POINT = 2;  // finer screens are drawn at this

/**
 * Squares that a program makes of numbers: so many texels of four floats for each, which the vertex shader fetches by itself.
 * Software drivers take an instance for a drawing of its own, 20 µs each; this is one drawing for all.
 */
class Squares {
  constructor(gl, vertex, fragment, texels) {
    Object.assign(this, { gl, texels, stride: 4 * texels, count: 0, rows: 0, data: new Float32Array(0) });
    this.program = this.link(vertex, fragment);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
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

  /** Make room for so many squares and begin anew; the caller writes `data` and counts. */
  begin(most) {
    const rows = Math.ceil(most / SQUARES_PER_ROW);
    if (this.data.length < rows * SQUARES_PER_ROW * this.stride) this.data = new Float32Array(rows * SQUARES_PER_ROW * this.stride);
    this.count = 0;
  }

  /** The data, with room for one more square. */
  room() {
    if ((this.count + 1) * this.stride > this.data.length) {
      const larger = new Float32Array(2 * Math.max(this.data.length, SQUARES_PER_ROW * this.stride));
      larger.set(this.data);
      this.data = larger;
    }
    return this.data;
  }

  draw(uniforms) {
    const { gl, data, texels } = this, rows = Math.ceil(this.count / SQUARES_PER_ROW), width = SQUARES_PER_ROW * texels;
    if (!this.count) return;
    gl.useProgram(this.program);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    if (rows > this.rows) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, rows, 0, gl.RGBA, gl.FLOAT, data.subarray(0, rows * width * 4));
      this.rows = rows;
    } else gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, rows, gl.RGBA, gl.FLOAT, data.subarray(0, rows * width * 4));
    const place = (name) => gl.getUniformLocation(this.program, name);
    gl.uniform2f(place("halfSize"), ...uniforms.halfSize);
    gl.uniform1f(place("focal"), uniforms.focal);
    gl.uniform1i(place("orthographic"), uniforms.orthographic);
    gl.drawArrays(gl.TRIANGLES, 0, 6 * this.count);
  }
}

/** Puts particles in order, the farthest first: as numbers that hold the depth in their upper bits and the particle below. */
class FarthestFirst {
  constructor(count) {
    this.keys = new Float64Array(count);
    this.order = new Uint32Array(count);
    this.depth = new Float32Array(1);
    this.bits = new Uint32Array(this.depth.buffer);  // grow with the number, where it is above 0
  }

  /** The particles before the eye, of places (right, up, depth) and radii. */
  of(seen, size) {
    let count = 0;
    for (let i = 0; i < size.length; i++) {
      if (size[i] === 0 || seen[3 * i + 2] <= 0) continue;
      this.depth[0] = seen[3 * i + 2];
      this.keys[count++] = this.bits[0] * MOST_PARTICLES + i;
    }
    const keys = this.keys.subarray(0, count).sort();
    for (let k = 0; k < count; k++) this.order[k] = keys[count - 1 - k] % MOST_PARTICLES;
    return this.order.subarray(0, count);
  }
}

/** Draws frames of a run into a canvas. Throws where the browser has no WebGL 2. */
class Drawing {
  constructor(canvas, run) {
    this.canvas = canvas;
    this.run = run;
    this.view = run.header.view;
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!gl) throw new Error("WebGL 2 is not available");
    this.gl = gl;
    this.prepare();
    this.seen = new Float64Array(3 * run.count);  // particles: right, up, depth [camera distances]
    this.size = new Float64Array(run.count);  // radii as drawn, 0 for what is not there
    this.repeats = this.view.period.some((edge) => edge > 0);
    this.order = new FarthestFirst(run.count);
    const { color } = run.columns;
    this.color = (frame, particle, k) => color.value(frame, 3 * particle + k);
  }

  /** What the card holds; once more after it has lost it. */
  prepare() {
    const { gl } = this;
    this.spheres = new Squares(gl, SPHERE_VERTEX, SPHERE_FRAGMENT, 2);
    this.lines = new Squares(gl, LINE_VERTEX, LINE_FRAGMENT, 3);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);  // of edges, with what was drawn before: lines, then spheres from the farthest to the nearest
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Draw a frame as a camera sees it, with trails of so many frames. */
  draw(frame, camera, trails) {
    const { gl, canvas, view } = this, ratio = Math.min(window.devicePixelRatio || 1, MOST_PIXELS_PER_POINT);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const focal = camera.focal(width, height);
    this.lineScale = camera.rows(width, height) / REFERENCE_ROWS;
    this.focal = focal;
    this.place(frame, camera, focal / ratio);
    this.writeSpheres(frame);
    this.writeLines(frame, camera, Math.min(trails, frame));
    gl.viewport(0, 0, width, height);
    gl.clearColor(...view.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const uniforms = { halfSize: [width / 2, height / 2], focal, orthographic: camera.orthographic };
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
    for (const i of this.order.of(seen, size)) {
      data[n] = seen[3 * i];
      data[n + 1] = seen[3 * i + 1];
      data[n + 2] = seen[3 * i + 2];
      data[n + 3] = size[i];
      for (let k = 0; k < 3; k++) data[n + 4 + k] = this.color(frame, i, k);
      n += spheres.stride;
    }
    spheres.count = n / spheres.stride;
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
    const { lines } = this, n = lines.count * lines.stride;
    if (!(Number.isFinite(a[i]) && Number.isFinite(b[j]))) return;
    const data = lines.room();
    for (let k = 0; k < 3; k++) {
      data[n + k] = a[i + k];
      data[n + 4 + k] = b[j + k];
    }
    data[n + 3] = width * this.lineScale;
    data[n + 8] = red;
    data[n + 9] = green;
    data[n + 10] = blue;
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

  /** The last ways of every particle, which fade into the background and become thinner; the newest are drawn last, on top. */
  writeTrails(frame, camera, length) {
    const { run: { columns, count, frameCount, path } } = this, see = camera.viewer();
    const cutter = new CurveCutter(this.focal, camera.orthographic, this.view.collides);
    const finer = new Set(path?.particles), all = Array.from({ length: count }, (_, i) => i).filter((i) => !finer.has(i));
    this.writeTrailsOf(frame, length, new Window6(columns, frameCount, see), all, (i) => i, 1, cutter);
    if (!path) return;
    const entries = path.particles.map((_, entry) => entry), rows = (frameCount - 1) * path.pieces + 1;
    this.writeTrailsOf(frame, length, new Window6(path.columns, rows, see), entries, (entry) => path.particles[entry], path.pieces, cutter);
  }

  /** The trails of some entries of columns that have so many rows for each frame. */
  writeTrailsOf(frame, length, moving, entries, particleOf, pieces, cutter) {
    const { background, trails: whole } = this.view, last = frame * pieces;
    if (!entries.length) return;
    moving.begin(last - length * pieces);
    for (; moving.at < last; moving.advance()) {
      for (const entry of entries) {
        const i = particleOf(entry);
        if (this.repeats && this.wrapped(moving, entry)) continue;
        cutter.cut(moving.places, 3 * entry, (ends, since, until) => {
          const age = (share) => (last - moving.at - share) / pieces, strength = 1 - (age(since) + age(until)) / 2 / whole;
          const shade = (k) => background[k] + strength * (this.color(frame, i, k) - background[k]);
          this.writeLine(ends, 3, ends, 0, shade(0), shade(1), shade(2), TRAIL_WIDTH * (1 - 0.5 * (age(until) + 1) / whole));
        });
      }
    }
  }

  /** Whether a particle has left a box that repeats between two frames and come in on the other side. */
  wrapped({ columns: { x, y, z }, at }, entry) {
    return [x, y, z].some((axis, k) => 2 * Math.abs(axis.value(at + 1, entry) - axis.value(at, entry)) > (this.view.period[k] || Infinity));
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
