/* The paper's robot with the shipped controller, both in C: gains in, a flight out. */
const CHUNK_TICKS = 500;

class Robot {
  constructor(binary, data) {
    this.data = data;
    this.prefix = `tdc_${data.controller}`;
    this.module = new Module(binary, data.structures);
    const module = this.module, given = data.arguments, n = given.plant.joints;
    this.joints = n;
    this.ticks = given.ticks;
    this.config = this.copyOf("config", module.exports[`${this.prefix}_default_config`].value);
    this.plant = module.structure("LoopPlant", given.plant);
    const timing = module.reserve(module.sizeOf("LoopTiming"));
    for (const [part, values] of Object.entries(given.timing)) {
      const to = module.field("LoopTiming", part, timing).address;
      const from = module.structure("LoopPart", values);
      module.view("u8", to, module.sizeOf("LoopPart"))
        .set(module.view("u8", from, module.sizeOf("LoopPart")));
    }
    const script = Object.fromEntries(Object.entries(given.script)
      .map(([name, row]) => [name, module.array(row, CHUNK_TICKS)]));
    this.script = module.structure("LoopScript", {
      ...script, timings: timing, numbers: given.numbers, numbers_count: given.numbers.values.length,
    });
    this.stateArrays = Object.fromEntries(Object.entries(given.state)
      .map(([name, one]) => [name, module.array(one)]));
    this.state = module.structure("LoopState", this.stateArrays);
    this.inputs = module.copy(bytesOf(given.inputs));
    this.holding = module.array(given.holding_torque);
    this.controller = module.structure("LoopController", {
      config: this.config, state: module.reserve(module.sizeOf("state")),
      ends: given.ends, ends_count: given.ends.values.length,
    });
    this.recordArrays = Object.fromEntries(Object.entries(given.record)
      .map(([name, row]) => [name, module.array(row, this.ticks)]));
    this.record = module.structure("LoopRecord", {});
    this.lastTick = module.reserve(8);
    this.status = module.reserve(8);
    this.gains = module.reserve(module.sizeOf("Gains"));
    this.points = module.reserve(16 * MOST_ROWS);
  }

  copyOf(structure, address) {
    const size = this.module.sizeOf(structure);
    return this.module.copy(this.module.view("u8", address, size).slice());
  }

  /* What the configuration has for a factor on Mbar: one of the slider's. */
  inertias(mbar) {
    const slider = this.data.sliders.find((one) => one.name === "mbar");
    return this.data.inertias[Math.round((value(mbar) - value(slider.low)) / value(slider.step))];
  }

  /* Writes the gains of every joint into the configuration; returns the C's verdict on it. */
  tune(gains) {
    const module = this.module, inertias = Object.entries(this.inertias(gains.mbar));
    for (let joint = 0; joint < this.joints; joint++) {
      const { type, address } = module.field("config", "joint", this.config, joint);
      for (const [quantity, { field, exponent }] of Object.entries(this.data.gains)) {
        const exact = gains[quantity];
        module.set(type, field, address, exponent ? exponentQ31(exact) : value(exact));
      }
      for (const [field, values] of inertias) { module.set(type, field, address, values[joint]); }
    }
    return module.exports[`${this.prefix}_check_config`](this.config);
  }

  /* One flight from rest, in parts between which the page may go on; latest gains count. */
  async fly(gains, pause = async () => {}) {
    const module = this.module, given = this.data.arguments;
    this.tune(gains);
    for (const [name, one] of Object.entries(given.state)) {
      module.view(one.type, this.stateArrays[name], one.values.length).set(one.values);
    }
    for (const [name, one] of Object.entries(given.record)) {
      const fill = one.type === "i64" ? BigInt(one.values[0]) : one.values[0];
      module.view(one.type, this.recordArrays[name], one.values.length * this.ticks).fill(fill);
    }
    let end = 0, first = 0;
    while (end === 0 && first < this.ticks) {
      if (first > 0) { await pause(); }
      const ticks = Math.min(CHUNK_TICKS, this.ticks - first);
      this.aim(first);
      end = module.exports.loop_run(this.plant, this.script, this.state, this.controller,
        this.record, BigInt(ticks), this.lastTick, this.status);
      first += end === 0 ? ticks : Number(module.view("i64", this.lastTick, 1)[0]);
    }
    return this.told(end, Math.max(first, 0));
  }

  /* Points the C at the part of the flight that begins with a tick. */
  aim(first) {
    const module = this.module, given = this.data.arguments;
    module.set("LoopController", "input", this.controller,
      this.inputs + first * module.sizeOf("input"));
    module.set("LoopController", "holding_torque", this.controller, first === 0 ? this.holding : 0);
    for (const [name, row] of Object.entries(given.record)) {
      module.set("LoopRecord", name, this.record,
        this.recordArrays[name] + first * row.values.length * module.sizeOf(row.type));
    }
  }

  /* What happened, copied out of the C's memory. */
  told(end, ticks) {
    const module = this.module, given = this.data.arguments;
    const flight = { end, ticks, status: Number(module.view("i64", this.status, 1)[0]), record: {} };
    for (const [name, row] of Object.entries(given.record)) {
      flight.record[name] = module.view(row.type, this.recordArrays[name],
        row.values.length * this.ticks).slice();
    }
    return flight;
  }

  /* A trajectory of the error dynamics, by the C's powers: pairs of e [rad] and its rate [rad/s]. */
  flow(gains, [e, rate], stepS, stepsPerRow, rows) {
    const module = this.module;
    const values = {
      kd: value(gains.kd), kp: value(gains.kp),
      alpha_minus_one_q31: exponentQ31(gains.alpha), beta_minus_one_q31: exponentQ31(gains.beta),
    };
    for (const [name, one] of Object.entries(values)) { module.set("Gains", name, this.gains, one); }
    module.view("f64", this.points, 2).set([e, rate]);
    module.exports.flow_run(this.gains, stepS, BigInt(stepsPerRow), BigInt(rows), this.points);
    return module.view("f64", this.points, 2 * rows).slice();
  }
}
const MOST_ROWS = 4096;
