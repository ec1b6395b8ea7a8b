/* Recorded ticks of a controller, repeated by its C in this page: which bits differ? */
function repeat(recorded) {
  const module = new Module(bytesOf(recorded.wasm), recorded.structures);
  const prefix = `tdc_${recorded.name}`, joints = recorded.joints;
  const init = module.exports[`${prefix}_init`], step = module.exports[`${prefix}_step`];
  const config = recorded.config ? module.copy(bytesOf(recorded.config))
    : module.exports[`${prefix}_default_config`].value;
  const state = module.reserve(module.sizeOf("state"));
  const counts = module.copy(bytesOf(recorded.counts));
  const held = module.copy(bytesOf(recorded.holding_torque));
  const inputs = module.copy(bytesOf(recorded.inputs));
  const torque = module.reserve(joints * module.sizeOf(recorded.torque_type));
  const expected = bytesOf(recorded.torque), width = joints * module.sizeOf(recorded.torque_type);
  const answer = { name: recorded.name, ticks: recorded.status.length, different: [] };
  if (init(config, state, counts, held) !== 0) { answer.different.push(-1); }
  recorded.status.forEach((status, tick) => {
    const told = step(config, state, inputs + tick * module.sizeOf("input"), torque);
    const bytes = module.view("u8", torque, width);
    const equal = told === status && bytes.every((byte, i) => byte === expected[tick * width + i]);
    if (!equal) { answer.different.push(tick); }
  });
  return answer;
}

/* A flight's torques beside the host's. */
function sameTorque({ record: { torque_commanded: torque, status } }, expected) {
  const bytes = new Uint8Array(torque.buffer), width = bytes.length / status.length;
  const different = [];
  for (let tick = 0; tick < status.length; tick++) {
    const row = bytes.subarray(tick * width, (tick + 1) * width);
    if (!row.every((byte, i) => byte === expected[tick * width + i])) { different.push(tick); }
  }
  return { ticks: status.length, different };
}
