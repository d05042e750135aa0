// The inspector: which quantity of the run or of a picked particle is plotted.

/** Quantities of one particle, or of it and another: what they are called, their unit, and their value in a frame. */
const OF_PARTICLE = {
  x: ["x", "length", (run, frame, i) => run.columns.x.value(frame, i)],
  y: ["y", "length", (run, frame, i) => run.columns.y.value(frame, i)],
  z: ["z", "length", (run, frame, i) => run.columns.z.value(frame, i)],
  speed: ["speed", "speed", (run, frame, i) => run.columns.speed.value(frame, i)],
  distance: ["distance", "length", (run, frame, i, other) => Math.hypot(...sum(run.place(frame, i), run.place(frame, other), -1))],
  way: ["distance from the start", "length", (run, frame, i) => Math.hypot(...sum(run.place(frame, i), run.place(0, i), -1))],
};

class Inspector {
  /** `changed` is called when the page has to be drawn again. */
  constructor(run, changed) {
    this.run = run;
    this.changed = changed;
    this.particle = -1;
    this.other = 0;
    this.plot = new Plot(document.getElementById("plot"));
    this.element = document.getElementById("inspector");
    this.choice = document.getElementById("quantity");
    this.number = document.getElementById("particle");
    this.second = document.getElementById("other");
    this.number.max = this.second.max = run.count - 1;
    this.offer();
    this.choice.addEventListener("change", () => this.update());
    this.number.addEventListener("change", () => this.pick(Number(this.number.value)));
    this.second.addEventListener("change", () => this.pickOther(Number(this.second.value)));
  }

  /** Fill the list of quantities. */
  offer() {
    const { series } = this.run.header, group = (label, options) => {
      const element = document.createElement("optgroup");
      element.label = label;
      element.append(...options.map(([text, value]) => new Option(text, value)));
      this.choice.append(element);
    };
    if (series) {
      const single = series.curves.map(({ label }, k) => [label, `run ${k}`]);
      const energies = series.curves.filter(({ group: axes }) => axes === "energy").length > 1 ? [["all energies", "energies"]] : [];
      group("of the run", [...single, ...energies]);
    }
    const named = Object.entries(OF_PARTICLE).filter(([key]) => key !== "speed" || this.run.columns.speed);
    group("of a particle", named.map(([key, [label]]) => [label, `particle ${key}`]));
  }

  /** Pick a particle, or none by −1; a quantity of the run gives way to one of the particle. */
  pick(particle) {
    this.particle = Number.isInteger(particle) && particle >= 0 && particle < this.run.count ? particle : -1;
    if (this.particle >= 0 && !this.choice.value.startsWith("particle")) this.choice.value = this.run.columns.speed ? "particle speed" : "particle x";
    this.update();
  }

  /** Pick the particle to which the distance of the first is plotted. */
  pickOther(particle) {
    if (!(Number.isInteger(particle) && particle >= 0 && particle < this.run.count)) return;
    this.other = particle;
    this.choice.value = "particle distance";
    this.update();
  }

  /** Whether two particles are compared. */
  get pairs() { return this.choice.value === "particle distance"; }

  /** The curves of the choice, over times in the unit of the caption. */
  curves() {
    const { size } = this.run.header.clock;
    return this.curvesOverTime().map((curve) => (size === 1 ? curve : { ...curve, times: curve.times.map((time) => time / size) }));
  }

  curvesOverTime() {
    const { run, choice: { value: chosen } } = this, { series } = run.header;
    if (chosen.startsWith("particle ")) {
      const [label, kind, value] = OF_PARTICLE[chosen.slice(9)], { units } = run.header;
      const unit = units && (kind === "speed" ? `${units.length}/${units.time}` : units.length);
      return [{ label, unit, times: run.times, values: run.times.map((_, frame) => value(run, frame, this.particle, this.other)) }];
    }
    const finite = ({ label, values }) => ({ label, times: series.times, values: values.map((value) => value ?? NaN) });
    if (chosen === "energies") {
      return series.curves.filter(({ group }) => group === "energy").map(finite).map((curve) => ({ ...curve, label: curve.label.replace(" energy", "") }));
    }
    return [finite(series.curves[Number(chosen.slice(4))])];
  }

  /** Lay the plot out anew: after a choice, and when the page has another size or other colours. */
  update() {
    this.changed();
    const ofParticle = this.choice.value.startsWith("particle");
    if (ofParticle && this.particle < 0) this.particle = 0;
    document.getElementById("who").hidden = !ofParticle;
    document.getElementById("whom").hidden = !this.pairs;
    this.number.value = Math.max(this.particle, 0);
    this.second.value = this.other;
    document.getElementById("particle-name").textContent = this.pairs ? "" : this.run.name(this.particle);
    if (this.element.hidden) return;
    const { unit } = this.run.header.clock;
    this.plot.show(this.curves(), unit ? `t [${unit}]` : "t");
  }

  draw(time) {
    if (!this.element.hidden) this.plot.draw(time / this.run.header.clock.size);
  }
}
