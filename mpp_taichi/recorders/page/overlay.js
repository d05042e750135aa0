// Texts over the picture: names of bodies and the scale bar; the counterpart of mpp_taichi/views/labels.py and scale_bar.py.

const NAME_SIZE = 13, BAR_TEXT_SIZE = 14;  // points
const NAME_GAP = 4, NAME_HEIGHT = 16;  // points
const MOST_NAMES = 300;
const BAR_SHARE = 0.18;  // of the width of the picture, before the length is rounded
const BAR_MARGIN = 18, BAR_TICK = 5;  // points
const EASY_LENGTHS = [0.01, 10000], LEAST_LENGTH = 0.5;  // of a chosen unit
const TEXT_FONT = "system-ui, sans-serif";

/** The nearest of 1, 2, 5 times a power of ten. */
function roundNumber(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const away = (digit) => Math.abs(Math.log(value / (digit * power)));
  return [1, 2, 5, 10].reduce((best, digit) => (away(digit) < away(best) ? digit : best)) * power;
}

/** The unit in which a length is easy to read, [sign, size]; of the scene's own unit, which is the first, and the others. */
function lengthUnit(units, length) {
  const [own, ...others] = units;
  if ((length >= EASY_LENGTHS[0] && length < EASY_LENGTHS[1]) || !others.length) return own;
  return others.findLast(([, size]) => length >= LEAST_LENGTH * size) ?? others[0];
}

class Overlay {
  constructor(canvas, run) {
    this.canvas = canvas;
    this.run = run;
    const { labels, scaleBar } = run.header.view;
    this.units = scaleBar;
    this.groups = labels === true ? Array.from({ length: run.count }, (_, i) => [run.name(i), i, 1]).filter(([name]) => name) : labels ?? [];
    this.wanted = this.groups.length > 0 || Boolean(scaleBar);
  }

  /** Draw over the picture that `drawing` has just drawn. */
  draw(drawing, camera, light) {
    if (!this.wanted) return;
    const { canvas } = this, { width, height } = drawing.canvas;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d"), ratio = width / drawing.canvas.clientWidth;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    Object.assign(context, { lineJoin: "round", fillStyle: light ? "#191920" : "#ebebf0", strokeStyle: light ? "#fff" : "#000" });
    this.names = this.tags(drawing, camera, context);
    Object.assign(context, { textAlign: "left", textBaseline: "middle", lineWidth: 3 });
    for (const { name, left, top } of this.names) {
      context.strokeText(name, left, top);
      context.fillText(name, left, top);
    }
    if (this.units) this.drawBar(drawing, camera, context);
  }

  /** The names to draw: of the nearest bodies first, and none over another. */
  tags(drawing, camera, context) {
    const { clientWidth: width, clientHeight: height } = drawing.canvas, focal = camera.focal(width, height), { seen } = drawing;
    const spot = (i) => {
      const found = drawing.spot(i, camera, focal, width, height);
      return found && { ...found, depth: seen[3 * i + 2] };
    };
    const spots = Array.from({ length: this.run.count }, (_, i) => spot(i)).filter(Boolean), tags = [];
    context.font = `${NAME_SIZE}px ${TEXT_FONT}`;
    const shown = this.groups.map(([name, first, count]) => ({ name, ...(count === 1 ? spot(first) : this.middle(first, count, drawing, camera)) }))
      .filter(({ depth, left, top }) => depth > 1e-3 && left >= 0 && left < width && top >= 0 && top < height)
      .sort((a, b) => a.depth - b.depth).slice(0, MOST_NAMES);
    for (const { name, left, top, radius, depth } of shown) {
      if (spots.some((other) => other.depth < depth && Math.hypot(other.left - left, other.top - top) + radius <= other.radius)) continue;
      const wide = context.measureText(name).width;
      const right = left + radius + NAME_GAP, begin = right + wide > width ? left - radius - NAME_GAP - wide : right;
      const tag = { name, left: begin, top, far: begin + wide };
      if (!tags.some((other) => tag.left < other.far && other.left < tag.far && Math.abs(tag.top - other.top) < NAME_HEIGHT)) tags.push(tag);
    }
    return tags;
  }

  /** Where the middle of a group is in the picture, as of a particle without a radius. */
  middle(first, count, drawing, camera) {
    const { clientWidth: width, clientHeight: height } = drawing.canvas, { seen } = drawing, sums = [0, 0, 0];
    let there = 0;
    for (let i = first; i < first + count; i++) {
      if (!Number.isFinite(seen[3 * i])) continue;
      there++;
      for (let k = 0; k < 3; k++) sums[k] += seen[3 * i + k];
    }
    const [right, up, depth] = sums.map((value) => value / there), focal = camera.focal(width, height);
    const scale = camera.orthographic ? focal : focal / depth;
    return { left: width / 2 + right * scale, top: height / 2 - up * scale, radius: 0, depth };
  }

  drawBar(drawing, camera, context) {
    const { clientWidth: width, clientHeight: height } = drawing.canvas;
    const perPixel = camera.visibleHeight / camera.rows(width, height), wanted = BAR_SHARE * width * perPixel;
    const [sign, size] = lengthUnit(this.units, wanted), number = roundNumber(wanted / size), long = number * size / perPixel;
    const text = `${number >= 1 && number < 1e7 ? Math.round(number).toLocaleString("en") : Number(number.toPrecision(6))} ${sign}`.trim();
    const end = width - BAR_MARGIN, begin = end - long, level = height - BAR_MARGIN;
    this.bar = { text, pixels: long };
    const path = new Path2D(`M${begin} ${level - BAR_TICK}v${2 * BAR_TICK}M${end} ${level - BAR_TICK}v${2 * BAR_TICK}M${begin} ${level}h${long}`);
    const { strokeStyle, fillStyle } = context;
    context.lineCap = "square";
    context.lineWidth = 4;
    context.stroke(path);
    context.strokeStyle = fillStyle;
    context.lineWidth = 2;
    context.stroke(path);
    Object.assign(context, { strokeStyle, lineWidth: 3, font: `${BAR_TEXT_SIZE}px ${TEXT_FONT}`, textAlign: "center", textBaseline: "bottom" });
    context.strokeText(text, (begin + end) / 2, level - BAR_TICK - 3);
    context.fillText(text, (begin + end) / 2, level - BAR_TICK - 3);
  }
}
