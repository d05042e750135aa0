// The player: time, keys, mouse and touch. Keys and mouse are those of mpp_taichi/views/controls.py.

const KEYS = [
  ["space", "play, pause"], ["← →", "one frame back, on (Shift: 50)"], ["↑ ↓", "faster, slower"], ["Home, Backspace", "to the start"],
  ["End", "to the end"], ["left drag, one finger", "rotate"], ["right drag, Shift+left, two fingers", "pan"],
  ["wheel, pinch, Ctrl+left, I, O", "zoom"], ["click", "pick a particle; beside all of them: none"],
  ["Shift+click", "pick another, to plot their distance"], ["R", "reset the camera"],
  ["F", "frame everything"], ["X Y Z", "look along an axis"], ["T", "trails on, off"], ["L", "begin again at the end, or stop"],
  ["P", "inspector"], ["C", "picture to a file"], ["K", "show the camera as a scene has it"], ["H", "this help"],
];
const MANY_FRAMES = 50;
const ZOOM_PER_NOTCH = 1.0015;  // factor for each point that a wheel rolls
const ZOOM_PER_HEIGHT = 8;  // factor for a drag over the height of the picture
const ZOOM_PER_KEY = 1.15;
const CLICK_REACH = 4;  // points that a pointer may wander in a click
const PLAY_ICON = "M6 3.5v13l11-6.5z", PAUSE_ICON = "M5 3.5h3.6v13H5zm6.4 0H15v13h-3.6z";

const element = (id) => document.getElementById(id);

/** A line in the middle of the page, for what cannot be done. */
function tell(text) {
  element("message").textContent = text;
  element("message").hidden = false;
}

class Player {
  constructor(run) {
    this.run = run;
    this.canvas = element("picture");
    this.camera = new Camera(run.header.camera);
    this.frame = 0;
    this.playing = false;
    this.speed = 1;
    this.loop = true;
    this.trails = run.header.view.trails > 0;
    this.shownCount = 0;  // frames drawn so far, for measurements
    this.dirty = true;
    this.pointers = new Map();
    this.inspector = new Inspector(run, () => { this.dirty = true; });
    try {
      this.drawing = new Drawing(this.canvas, run);
    } catch (error) {
      tell(`The picture cannot be drawn here: ${error.message}.\nA browser of the last years with WebGL 2 shows it; the plot works without.`);
    }
    this.overlay = new Overlay(element("overlay"), run);
    this.furnish();
    this.listen();
    this.inspector.update();
    requestAnimationFrame((now) => this.tick(now));
  }

  /** What the page shows of this run. */
  furnish() {
    const { header, frameCount } = this.run, [red, green, blue] = header.view.background;
    document.documentElement.style.background = `rgb(${[red, green, blue].map((value) => 255 * value).join(" ")})`;
    element("stage").className = 0.299 * red + 0.587 * green + 0.114 * blue > 0.5 ? "on-light" : "on-dark";
    element("caption").hidden = !header.view.caption;
    element("slider").max = frameCount - 1;
    element("trails").hidden = header.view.trails === 0;
    for (const note of header.notes) element("notes").append(Object.assign(document.createElement("li"), { textContent: note }));
    for (const [key, text] of KEYS) {
      const row = element("keys").insertRow();
      row.insertCell().textContent = key;
      row.insertCell().textContent = text;
    }
    if (matchMedia("(max-width: 700px), (max-height: 480px)").matches) this.toggleInspector();
    this.showState();
  }

  // --- time -------------------------------------------------------------------------------------------------------------

  play(on = true) {
    if (on && this.frame >= this.run.frameCount - 1 && !this.loop) this.go(0);
    this.playing = on && this.run.frameCount > 1;
    this.began = null;
    this.showState();
  }

  /** Show a frame; outside of the run, its first or last. */
  go(frame) {
    this.frame = Math.min(Math.max(Math.round(frame), 0), this.run.frameCount - 1);
    this.began = null;
    this.dirty = true;
  }

  /** Show the frame nearest to a time of the run. */
  goToTime(time) {
    const { times } = this.run;
    let best = 0;
    for (let k = 1; k < times.length; k++) if (Math.abs(times[k] - time) < Math.abs(times[best] - time)) best = k;
    this.go(best);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.began = null;
    element("speed").value = String(speed);
  }

  /** Once for each picture of the screen: the frame that is due, drawn if it is another or seen from elsewhere. */
  tick(now) {
    requestAnimationFrame((later) => this.tick(later));
    if (this.playing) this.advance(now);
    if (this.dirty) this.draw();
  }

  /** The frame due by the clock since playing began here; frames that a slow machine misses are left out. */
  advance(now) {
    this.began ??= { now, frame: this.frame };
    const { frameCount, header: { fps } } = this.run;
    let due = this.began.frame + Math.floor((now - this.began.now) / 1000 * fps * this.speed + 1e-6);
    if (due >= frameCount && this.loop) {
      this.began = { now, frame: 0 };
      due = 0;
    } else if (due >= frameCount - 1 && !this.loop) {
      due = frameCount - 1;
      this.play(false);
    }
    if (due !== this.frame) {
      this.frame = due;
      this.dirty = true;
    }
  }

  draw() {
    this.dirty = false;
    this.shownCount++;
    const { frame, run, camera } = this, { captions, dimmed } = run.header, time = run.times[frame];
    this.drawing?.draw(frame, camera, this.trails ? run.header.view.trails : 0);
    if (this.drawing) this.overlay.draw(this.drawing, camera, element("stage").classList.contains("on-light"));
    element("time").textContent = `t = ${run.clockText(time)}`;
    element("extra").textContent = captions ? captions[frame] : "";
    element("stage").classList.toggle("dimmed", Boolean(dimmed?.[frame]));
    element("slider").value = frame;
    element("count").textContent = `${frame + 1} / ${run.frameCount}`;
    this.inspector.draw(time);
    this.mark();
  }

  /** A ring around the picked particle, and around the one that it is compared with, and their names. */
  mark() {
    const { inspector } = this;
    this.ring(element("marker"), inspector.particle);
    this.ring(element("other-marker"), inspector.pairs && !inspector.element.hidden ? inspector.other : -1);
  }

  ring(marker, particle) {
    const { clientWidth: width, clientHeight: height } = this.canvas, focal = this.camera.focal(width, height);
    const spot = particle >= 0 && this.drawing ? this.drawing.spot(particle, this.camera, focal, width, height) : null;
    marker.hidden = !spot;
    if (!spot) return;
    const radius = Math.max(spot.radius, 1) + 5, side = `${2 * radius}px`;
    Object.assign(marker.style, { left: `${spot.left - radius}px`, top: `${spot.top - radius}px`, width: side, height: side });
    marker.firstElementChild.textContent = this.run.name(particle) || particle;
  }

  // --- what is switched -------------------------------------------------------------------------------------------------

  showState() {
    element("play-icon").setAttribute("d", this.playing ? PAUSE_ICON : PLAY_ICON);
    for (const [id, on] of [["loop", this.loop], ["trails", this.trails], ["plotting", !this.inspector.element.hidden]]) {
      element(id).setAttribute("aria-pressed", String(on));
    }
    this.dirty = true;
  }

  toggle(what) {
    this[what] = !this[what];
    this.showState();
  }

  toggleInspector() {
    this.inspector.element.hidden = !this.inspector.element.hidden;
    this.inspector.update();
    this.showState();
  }

  help() {
    if (element("about").open) element("about").close();
    else element("about").showModal();
  }

  savePicture() {
    this.draw();  // in the same turn as it is read, or it is gone
    let picture = this.canvas;
    if (this.overlay.wanted && this.drawing) {
      const { width, height } = picture;
      picture = Object.assign(document.createElement("canvas"), { width, height });
      for (const layer of [this.canvas, this.overlay.canvas]) picture.getContext("2d").drawImage(layer, 0, 0);
    }
    picture.toBlob((blob) => {
      const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob) });
      link.download = `${this.run.header.scene.replace(/\.[^.]*$/, "") || "scene"}_${String(this.frame).padStart(6, "0")}.png`;
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  frameAll() {
    const { run, frame, canvas } = this;
    this.camera.frameAll(Array.from({ length: run.count }, (_, i) => run.place(frame, i)), canvas.clientWidth / canvas.clientHeight);
  }

  // --- keys, mouse, touch -----------------------------------------------------------------------------------------------

  listen() {
    const { canvas } = this, on = (id, event, action) => element(id).addEventListener(event, action);
    on("play", "click", () => this.play(!this.playing));
    on("loop", "click", () => this.toggle("loop"));
    on("trails", "click", () => this.toggle("trails"));
    on("plotting", "click", () => this.toggleInspector());
    on("help", "click", () => this.help());
    on("slider", "input", () => { this.play(false); this.go(Number(element("slider").value)); });
    on("speed", "change", () => this.setSpeed(Number(element("speed").value)));
    // After a click the keys are the player's again, or space would press the button once more.
    element("bar").addEventListener("pointerup", (event) => { if (event.target.closest("button")) setTimeout(() => canvas.focus()); });
    this.listenToPlot(element("plot"));
    addEventListener("keydown", (event) => this.press(event));
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.release(event));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.camera.zoom(ZOOM_PER_NOTCH ** -(event.deltaMode === 1 ? 30 * event.deltaY : event.deltaY));
      this.dirty = true;
    }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { this.drawing.prepare(); this.dirty = true; });
    const again = () => this.inspector.update();
    addEventListener("resize", again);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  }

  listenToPlot(plot) {
    const seek = (event) => {
      if (!(event.buttons & 1)) return;
      this.play(false);
      this.goToTime(this.inspector.plot.timeAt(event.offsetX) * this.run.header.clock.size);
    };
    plot.addEventListener("pointerdown", (event) => { plot.setPointerCapture(event.pointerId); seek(event); });
    plot.addEventListener("pointermove", seek);
  }

  press(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches("select, input[type=number]")) return;
    if (element("about").open && key !== "h" && key !== "H") return;
    if (key === " " && target.matches("button")) return;  // which it presses
    const action = this.actions(event.shiftKey ? MANY_FRAMES : 1)[key.length === 1 ? key.toLowerCase() : key];
    if (!action) return;
    event.preventDefault();
    action();
    this.dirty = true;
  }

  actions(many) {
    const step = (count) => () => { this.play(false); this.go(this.frame + count); };
    const faster = (by) => () => {
      const speeds = [...element("speed").options].map((option) => Number(option.value)), at = speeds.indexOf(this.speed) + by;
      if (at in speeds) this.setSpeed(speeds[at]);
    };
    const start = () => this.go(0), along = (axis) => () => this.camera.lookAlong(axis);
    return {
      " ": () => this.play(!this.playing), ArrowRight: step(many), ArrowLeft: step(-many), ArrowUp: faster(1), ArrowDown: faster(-1),
      Home: start, Backspace: start, End: () => { this.play(false); this.go(Infinity); },
      r: () => this.camera.reset(), f: () => this.frameAll(), x: along("x"), y: along("y"), z: along("z"),
      i: () => this.camera.zoom(ZOOM_PER_KEY), o: () => this.camera.zoom(1 / ZOOM_PER_KEY),
      t: () => this.toggle("trails"), l: () => this.toggle("loop"), p: () => this.toggleInspector(), h: () => this.help(),
      c: () => this.savePicture(), k: () => this.showCamera(),
    };
  }

  showCamera() {
    const message = element("message"), text = this.camera.asYaml();
    if (message.hidden) tell(text);
    else message.hidden = true;
    navigator.clipboard?.writeText(text).catch(() => {});  // where it may not be written, it is read
  }

  grab(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    this.wandered = this.pointers.size > 1 ? Infinity : 0;
    element("message").hidden ||= !!this.drawing;
  }

  move(event) {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.x, dy = event.clientY - last.y, rows = this.camera.rows(this.canvas.clientWidth, this.canvas.clientHeight);
    this.wandered += Math.hypot(dx, dy);
    const before = this.spread();
    Object.assign(last, { x: event.clientX, y: event.clientY });
    if (this.wandered <= CLICK_REACH) return;
    const { camera } = this;
    if (this.pointers.size > 1) {
      const share = 1 / this.pointers.size;  // each finger moves the middle by its share
      camera.pan(share * dx / rows, -share * dy / rows);
      camera.zoom(this.spread() / before);
    } else if (event.buttons & 2 || event.shiftKey) camera.pan(dx / rows, -dy / rows);
    else if (event.buttons & 4 || event.ctrlKey) camera.zoom(ZOOM_PER_HEIGHT ** (-dy / rows));
    else camera.rotate(dx / rows, -dy / rows);
    this.dirty = true;
  }

  /** Distance of the first two fingers. */
  spread() {
    const [a, b] = this.pointers.values();
    return b ? Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1) : 1;
  }

  release(event) {
    const held = this.pointers.delete(event.pointerId);
    if (!held || event.type !== "pointerup" || event.button !== 0 || this.wandered > CLICK_REACH || !this.drawing) return;
    const found = this.drawing.pick(event.offsetX, event.offsetY, this.camera);
    if (event.shiftKey) this.inspector.pickOther(found);
    else this.inspector.pick(found);
  }
}

/** Unpack the run, open the player, and go to the frame that the address asks for, as in page.html#frame=12; else play. */
async function open() {
  if (typeof DecompressionStream === "undefined") {
    tell("This browser cannot unpack the recorded run: it has no DecompressionStream. Browsers since 2023 have it.");
    return null;
  }
  const made = new Player(await Run.unpack(JSON.parse(element("header").textContent), element("block").textContent));
  const asked = /^#frame=(\d+)$/.exec(location.hash);
  if (asked) made.go(Number(asked[1]));
  else made.play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  return made;
}

let player = null;
open().then((made) => { player = made; }, (error) => tell(`The page cannot be played: ${error.message}`));
