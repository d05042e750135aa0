// The recorded run: what the page carries, unpacked. The counterpart of mpp_taichi/recorders/_column_code.py and _html_page.py.

/** The bytes of a base64 text that was compressed with zlib. */
async function inflate(text) {
  const packed = atob(text), bytes = new Uint8Array(packed.length);
  for (let n = 0; n < packed.length; n++) bytes[n] = packed.charCodeAt(n);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Takes typed arrays off a block of bytes, one after the other. */
class Reader {
  constructor(bytes) { this.bytes = bytes; this.offset = 0; }

  take(Type, count) {
    const size = count * Type.BYTES_PER_ELEMENT;
    if (this.offset + size > this.bytes.length) throw new Error("the recorded data end too early");
    const part = this.bytes.slice(this.offset, this.offset + size);
    this.offset += size;
    return new Type(part.buffer);
  }
}

/** Numbers of every entry in every frame: origin[i] + step[i] * code, where the largest code means: not a number. */
class Column {
  constructor(reader, { entries, bytes, order }, frames) {
    this.entries = entries;
    this.origin = reader.take(Float64Array, entries);
    this.step = reader.take(Float64Array, entries);
    this.constant = bytes === 0;
    this.absent = 2 ** (8 * bytes) - 1;
    this.code = this.constant ? null : this.unfold(reader, bytes, order, frames);
  }

  /** Planes of bytes, lowest first, to codes: the sign is in the lowest bit, and differences are summed up along the frames. */
  unfold(reader, bytes, order, frames) {
    const count = frames * this.entries, mask = this.absent;
    const code = new (bytes === 1 ? Uint8Array : bytes === 2 ? Uint16Array : Uint32Array)(count);
    for (let plane = 0; plane < bytes; plane++) {
      const part = reader.take(Uint8Array, count);
      for (let n = 0; n < count; n++) code[n] |= part[n] << (8 * plane);
    }
    for (let n = 0; n < count; n++) code[n] = ((code[n] >>> 1) ^ -(code[n] & 1)) & mask;
    for (let pass = 0; pass < order; pass++) {
      for (let n = this.entries; n < count; n++) code[n] = (code[n] + code[n - this.entries]) & mask;
    }
    return code;
  }

  value(frame, entry) {
    if (this.constant) return this.origin[entry];
    const code = this.code[frame * this.entries + entry];
    return code === this.absent ? NaN : this.origin[entry] + this.step[entry] * code;
  }
}

/** The whole run: columns by name, springs of each stretch of frames, and the header. */
class Run {
  static async unpack(header, text) {
    return new Run(header, new Reader(await inflate(text)));
  }

  constructor(header, reader) {
    this.header = header;
    this.times = header.times;
    this.frameCount = header.times.length;
    this.columns = {};
    for (const description of header.columns) this.columns[description.name] = new Column(reader, description, this.frameCount);
    this.count = this.columns.x.entries;
    this.path = this.finerPath(header.path, reader);
    this.springs = header.springs.map(({ first, count }) => ({ first, count, between: reader.take(Int32Array, 2 * count) }));
    header.springs.forEach(({ color, frames }, n) => { this.springs[n].color = new Column(reader, color, frames); });
  }

  /** Places between the frames of the particles that turn far from frame to frame; null where there are none. */
  finerPath(path, reader) {
    if (!path) return null;
    const columns = {}, rows = (this.frameCount - 1) * path.pieces + 1;
    for (const description of path.columns) columns[description.name.replace("path_", "")] = new Column(reader, description, rows);
    return { ...path, columns };
  }

  /** The springs of a frame: they change where a timeline changes them. */
  springsAt(frame) {
    return this.springs.findLast(({ first }) => first <= frame);
  }

  /** The place of a particle, [x, y, z]; not numbers where it is gone. */
  place(frame, particle) {
    const { x, y, z } = this.columns;
    return [x.value(frame, particle), y.value(frame, particle), z.value(frame, particle)];
  }

  /** A time as a reader wants it, in the unit of this run and with the same decimals in all frames. */
  clockText(time) {
    const { size, unit, decimals, power } = this.header.clock, value = time / size / 10 ** power;
    let number = decimals === null ? spelled(value) : value.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");
    if (power) number += `e${power}`;
    return unit ? `${number} ${unit}` : number;
  }

  name(particle) {
    return this.header.names?.[particle] ?? "";
  }
}
