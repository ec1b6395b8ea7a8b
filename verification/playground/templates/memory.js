/* The memory of a WebAssembly module: structures by the layout that the page was made with. */
const ACCESS = {
  u8: ["Uint8", 1], i32: ["Int32", 4], u32: ["Uint32", 4], i64: ["BigInt64", 8],
  f32: ["Float32", 4], f64: ["Float64", 8],
};
const VIEWS = {
  u8: Uint8Array, i32: Int32Array, u32: Uint32Array, i64: BigInt64Array,
  f32: Float32Array, f64: Float64Array,
};
const PAGE_BYTES = 65536;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) { bytes[i] = text.charCodeAt(i); }
  return bytes;
}

/* The functions and the memory of one module; what is reserved is never given back. */
class Module {
  constructor(binary, structures) {
    this.exports = new WebAssembly.Instance(new WebAssembly.Module(binary), {}).exports;
    this.structures = structures;
    this.top = this.exports.__heap_base.value;
  }

  /* Addresses of zeros; aligned for every type. */
  reserve(bytes) {
    const address = Math.ceil(this.top / 16) * 16;
    this.top = address + bytes;
    const memory = this.exports.memory;
    const missing = this.top - memory.buffer.byteLength;
    if (missing > 0) { memory.grow(Math.ceil(missing / PAGE_BYTES)); }
    return address;
  }

  sizeOf(type) { return ACCESS[type] ? ACCESS[type][1] : this.structures[type].size; }

  /* A view, which is good until more memory is reserved. */
  view(type, address, count) { return new VIEWS[type](this.exports.memory.buffer, address, count); }

  copy(bytes) {
    const address = this.reserve(bytes.length);
    this.view("u8", address, bytes.length).set(bytes);
    return address;
  }

  /* Numbers as an array of C; `rows` times the same ones. */
  array({ type, values }, rows = 1) {
    const address = this.reserve(this.sizeOf(type) * values.length * rows);
    const view = this.view(type, address, values.length * rows);
    view.set(Array.from({ length: view.length }, (_, i) => {
      const value = values[i % values.length];
      return type === "i64" ? BigInt(value) : value;
    }));
    return address;
  }

  /* Where a field is; `index` counts the elements of an array. */
  field(structure, name, address, index = 0) {
    const [type, offset] = this.structures[structure].fields[name];
    return { type, address: address + offset + index * this.sizeOf(type) };
  }

  set(structure, name, address, value) {
    const at = this.field(structure, name, address);
    const number = at.type === "i64" ? BigInt(value) : value;
    const view = new DataView(this.exports.memory.buffer);
    view[`set${ACCESS[at.type][0]}`](at.address, number, true);
  }

  get(structure, name, address) {
    const at = this.field(structure, name, address);
    return new DataView(this.exports.memory.buffer)[`get${ACCESS[at.type][0]}`](at.address, true);
  }

  /* A structure of C with these fields; objects of numbers become pointers to them. */
  structure(name, values) {
    const address = this.reserve(this.structures[name].size);
    for (const [field, value] of Object.entries(values)) {
      this.set(name, field, address, typeof value === "object" ? this.array(value) : value);
    }
    return address;
  }
}
