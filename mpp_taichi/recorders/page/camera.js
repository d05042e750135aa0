// Orbit camera: the counterpart of mpp_taichi/views/camera.py, with the same hand.

const POLE = 89 * Math.PI / 180;  // a turntable never quite looks along its own axis
const AXIS_VIEWS = { x: [[1, 0, 0], [0, 0, 1]], y: [[0, -1, 0], [0, 0, 1]], z: [[0, 0, 1], [0, 1, 0]] };

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, b, factor = 1) => a.map((value, k) => value + factor * b[k]);
const scaled = (a, factor) => a.map((value) => value * factor);
const unit = (a) => scaled(a, 1 / Math.hypot(...a));

/** A turntable around `target`: `backward` points from the target to the camera, `axis` is what rotation turns about. */
class Camera {
  constructor(start) {
    this.start = start;
    this.reset();
  }

  reset() {
    const { target, backward, axis, distance, height, fieldOfView, orthographic } = this.start;
    Object.assign(this, { target, backward, axis, distance, height, orthographic });
    this.slope = Math.tan(fieldOfView * Math.PI / 360);  // half the picture's height at unit distance
  }

  get right() { return unit(cross(this.axis, this.backward)); }
  get up() { return cross(this.backward, this.right); }
  get position() { return sum(this.target, this.backward, this.distance); }

  /** Height of the picture at the depth of the target [length]. */
  get visibleHeight() { return this.orthographic ? this.height : 2 * this.distance * this.slope; }

  /** Rows that the field of view spans: all of them, or fewer in a window narrower than the picture was meant to be. */
  rows(width, height) { return Math.min(height, width / this.start.aspect); }

  /** Pixels per unit of x/z, or of x where orthographic, in lengths of the camera's distance. */
  focal(width, height) {
    return this.rows(width, height) * (this.orthographic ? this.distance / this.height : 0.5 / this.slope);
  }

  /** From a place to (right, up, depth) in camera distances, written into `out` from `at` on. */
  viewer() {
    const { target: t, distance } = this, r = scaled(this.right, 1 / distance), u = scaled(this.up, 1 / distance);
    const b = scaled(this.backward, 1 / distance);
    return (x, y, z, out, at) => {
      const dx = x - t[0], dy = y - t[1], dz = z - t[2];
      out[at] = dx * r[0] + dy * r[1] + dz * r[2];
      out[at + 1] = dx * u[0] + dy * u[1] + dz * u[2];
      out[at + 2] = 1 - (dx * b[0] + dy * b[1] + dz * b[2]);
    };
  }

  /** Drag by shares of the picture's height: the scene follows the hand, half a turn per height. */
  rotate(right, up) {
    const azimuth = -Math.PI * right, along = scaled(this.axis, dot(this.axis, this.backward));
    let level = sum(this.backward, along, -1);
    level = sum(scaled(level, Math.cos(azimuth)), cross(this.axis, this.backward), Math.sin(azimuth));
    const height = Math.min(Math.max(dot(this.axis, this.backward), -1), 1);
    const elevation = Math.min(Math.max(Math.asin(height) - Math.PI * up, -POLE), POLE);
    this.backward = sum(scaled(unit(level), Math.cos(elevation)), this.axis, Math.sin(elevation));
  }

  /** Drag by shares of the picture's height: the point under the hand at the target's depth stays under it. */
  pan(right, up) {
    this.target = sum(sum(this.target, this.right, -right * this.visibleHeight), this.up, -up * this.visibleHeight);
  }

  /** Make the picture larger by a factor. */
  zoom(factor) {
    this.distance /= factor;
    this.height /= factor;
  }

  lookAlong(name) {
    [this.backward, this.axis] = AXIS_VIEWS[name];
  }

  /** Aim at the middle of these places and step back until a sphere around all of them is in view. */
  frameAll(places, aspect) {
    const seen = places.filter((place) => place.every(Number.isFinite));
    if (!seen.length) return;
    const low = [0, 1, 2].map((k) => seen.reduce((least, place) => Math.min(least, place[k]), Infinity));
    const high = [0, 1, 2].map((k) => seen.reduce((most, place) => Math.max(most, place[k]), -Infinity));
    this.target = scaled(sum(low, high), 0.5);
    const reach = this.start.margin * (Math.max(...seen.map((place) => Math.hypot(...sum(place, this.target, -1)))) || this.distance);
    this.distance = reach / Math.sin(Math.min(Math.atan(this.slope), Math.atan(this.slope * aspect)));
    this.height = 2 * reach / Math.min(aspect, 1);
  }

  /** The `view:` entry of a scene that puts the camera where it is now. */
  asYaml() {
    const list = (vector) => `[${vector.map((value) => Number(value.toPrecision(6))).join(", ")}]`;
    const lines = ["view:", "  camera:", `    position: ${list(this.position)}`, `    look_at: ${list(this.target)}`];
    lines.push(`    up: ${list(this.axis)}`, `    field_of_view: ${Number(this.start.fieldOfView.toPrecision(6))}`);
    if (this.orthographic) lines.push("    projection: orthographic", `    height: ${Number(this.height.toPrecision(6))}`);
    return lines.join("\n");
  }
}
