const byId = (id) => document.getElementById(id);
const DEG = 180 / Math.PI;
const WINDOWS = { whole: null, turn: [2.7, 3.7], ticks: [3.0, 3.1] };
const FLOW = { stepS: 5e-4, steps: 4, rows: 1500 };
const SETTLING = { stepS: 2e-4, steps: 5, rows: 3001 };
/* What is smaller is a matter of the step. */
const LEAST_RAD = 1e-7;

/* What the sliders say; gains are fractions. */
const state = { gains: null, tied: true, joint: 0, time: "whole", start: [1, 0] };
const shown = { now: null, kept: null };
let data, robot, charts, references;

/* --- Sliders ------------------------------------------------------------------------------- */

function placed(slider, index) {
  const [n, d] = slider.step;
  const [a, b] = slider.low;
  return fraction(a * d + index * n * b, b * d);
}

function nearest(slider, gain) {
  return Math.round((value(gain) - value(slider.low)) / value(slider.step));
}

function written(gain, digits = 3) { return Number(value(gain).toFixed(digits)).toString(); }

function inertiaText(factor) {
  return `× ${written(factor)} = ${robot.inertias(factor).inertia_kgm2[state.joint].toPrecision(3)} kg m²`;
}

function showSliders() {
  for (const slider of data.sliders) {
    const gain = state.gains[slider.name], input = byId(`slider-${slider.name}`);
    if (document.activeElement !== input || Number(input.value) !== nearest(slider, gain)) {
      input.value = nearest(slider, gain);
    }
    input.setAttribute("aria-valuetext", written(gain));
    byId(`value-${slider.name}`).textContent = slider.name === "mbar" ? inertiaText(gain) : written(gain);
  }
  byId("tie").checked = state.tied;
  for (const button of document.querySelectorAll("[data-preset]")) {
    const { gains } = data.presets.find((one) => one.name === button.dataset.preset);
    button.setAttribute("aria-pressed", Object.keys(gains).every((name) => same(gains[name], state.gains[name])));
  }
}

function choose(gains) {
  state.gains = { ...gains };
  state.tied = same(gains.beta, finiteTimeBeta(gains.alpha));
  refresh();
}

function moved(slider, index) {
  state.gains[slider.name] = placed(slider, index);
  if (slider.name === "beta") { state.tied = false; }
  if (state.tied) { state.gains.beta = finiteTimeBeta(state.gains.alpha); }
  refresh();
}

/* --- Flights ------------------------------------------------------------------------------- */

function pause() {
  return new Promise((resume) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => { port1.close(); resume(); };
    port2.postMessage(0);
  });
}

let running = null, wanted = false;

/* Draws the error dynamics at once, and flies: the newest gains, and none that are past. */
function refresh() {
  showSliders();
  showDynamics();
  wanted = true;
  running ??= flyAll().finally(() => { running = null; });
  return running;
}

async function flyAll() {
  while (wanted) {
    wanted = false;
    const gains = { ...state.gains };
    shown.now = measured(await robot.fly(gains, pause), gains);
    showFlight();
    await pause();
  }
}

/* The figures of a flight; one number a joint. */
function measured(flight, gains) {
  const { counts, torque_applied_Nm: torque, status } = flight.record;
  const n = robot.joints, ticks = flight.ticks;
  const saturated = status.subarray(0, ticks).filter((one) => one === 1n).length;
  const lost = status.subarray(0, ticks).filter((one) => one < 0n).length;
  const each = (of) => Array.from({ length: n }, (_, joint) => of(joint));
  const error = each((joint) => {
    const scale = data.rad_per_count[joint] * DEG, q8 = references[joint];
    return Float64Array.from({ length: ticks }, (_, k) => (q8[k] / 256 - counts[k * n + joint]) * scale);
  });
  const applied = each((joint) => Float64Array.from({ length: ticks }, (_, k) => torque[k * n + joint]));
  return {
    flight, gains, error, applied,
    friction: each((joint) => Float64Array.from({ length: ticks }, (_, k) => flight.record.friction_Nm[k * n + joint])),
    position: each((joint) => Float64Array.from({ length: ticks }, (_, k) => counts[k * n + joint] * data.rad_per_count[joint] * DEG)),
    rms: error.map((one) => Math.sqrt(one.reduce((sum, e) => sum + e * e, 0) / ticks)),
    peak: error.map((one) => one.reduce((most, e) => Math.max(most, Math.abs(e)), 0)),
    activity: applied.map((one) => {
      let sum = 0;
      for (let k = 1; k < ticks; k++) { sum += (one[k] - one[k - 1]) ** 2; }
      return Math.sqrt(sum / (ticks - 1));
    }),
    strongest: applied.map((one) => one.reduce((most, t) => Math.max(most, Math.abs(t)), 0)),
    saturated, lost, alarm: alarmOf(flight, saturated, lost),
  };
}

/* What is wrong with a flight, if anything is. */
function alarmOf({ end, ticks, status }, saturated, lost) {
  const when = (ticks * data.arguments.sample_time_s).toFixed(3);
  if (end === 2) { return `At ${when} s the motion has left all bounds. These gains are not safe.`; }
  if (end !== 0) {
    const [name, meaning] = data.statuses[status];
    return `At ${when} s the controller gave up with TDC_${name}: ${meaning}. These gains are not safe.`;
  }
  if (lost > 0) { return `In ${lost} ticks the motion was so violent that the C took it for an encoder’s fault. These gains are not safe.`; }
  const share = 100 * saturated / ticks;
  return share >= 0.1 ? `A torque is at its limit in ${share.toPrecision(2)} % of all ticks: the loop vibrates, or is about to.` : "";
}

function milli(deg) { return deg * 1000 >= 9.95 ? (deg * 1000).toFixed(0) : (deg * 1000).toPrecision(2); }
function newtons(torque) { return torque >= 99.5 ? torque.toFixed(0) : torque.toPrecision(2); }

function showFlight() {
  const { now, kept } = shown, joint = state.joint;
  const alarm = byId("alarm");
  alarm.textContent = now.alarm;
  alarm.hidden = !now.alarm;
  for (const one of document.querySelectorAll(".joint-name")) { one.textContent = data.joint_names[joint]; }
  byId("rms").textContent = milli(now.rms[joint]);
  byId("activity").textContent = newtons(now.activity[joint]);
  byId("rms-more").textContent = kept
    ? compared(kept.rms[joint], now.rms[joint], milli, "times smaller than", "times larger than") : "";
  byId("activity-more").textContent = kept
    ? compared(kept.activity[joint], now.activity[joint], newtons, "times calmer than", "times livelier than") : "";
  byId("line").textContent = [
    byId("class").textContent, byId("origin").textContent,
    `RMS ${milli(now.rms[joint])}·10⁻³ deg`, `${newtons(now.activity[joint])} N m a tick`,
  ].join(" · ");
  byId("ticks").textContent = `Ticks with a torque at its limit: ${now.saturated} of ${robot.ticks}; lost ticks: ${now.lost}.`;
  showTable();
  drawFlight();
}

/* A figure beside that of the grey lines, in words. */
function compared(grey, now, write, less, more) {
  const factor = grey / now, than = `grey (${write(grey)})`;
  if (!Number.isFinite(factor) || (factor > 0.95 && factor < 1.05)) { return `about the same as ${than}`; }
  return factor > 1 ? `${factor.toPrecision(2)} ${less} ${than}` : `${(1 / factor).toPrecision(2)} ${more} ${than}`;
}

function showTable() {
  const { now, kept } = shown;
  const rows = data.joint_names.map((name, joint) => {
    const row = document.createElement("tr");
    const head = document.createElement("th");
    head.textContent = name;
    row.append(head);
    const cell = (of, write) => {
      const made = document.createElement("td");
      made.className = "number";
      made.textContent = write(of(now));
      if (kept) {
        const grey = document.createElement("span");
        grey.className = "kept";
        grey.textContent = ` (${write(of(kept))})`;
        made.append(grey);
      }
      row.append(made);
    };
    cell((one) => one.rms[joint], milli);
    cell((one) => one.peak[joint], milli);
    cell((one) => one.activity[joint], newtons);
    cell((one) => one.strongest[joint], newtons);
    cell((one) => robot.inertias(one.gains.mbar).inertia_kgm2[joint], (inertia) => inertia.toPrecision(3));
    return row;
  });
  byId("figures").tBodies[0].replaceChildren(...rows);
}

function drawFlight() {
  const { now, kept } = shown, joint = state.joint, step = data.arguments.sample_time_s;
  const whole = [0, robot.ticks * step];
  const xRange = WINDOWS[state.time] ?? whole;
  const within = (one) => one.subarray(Math.round(xRange[0] / step), Math.round(xRange[1] / step) + 1);
  const scaled = (one) => one.map((e) => e * 1000);
  const errors = [...(kept ? [scaled(kept.error[joint])] : []), scaled(now.error[joint])];
  const colours = kept ? ["--kept", "--now"] : ["--now"];
  charts.error.draw({
    xRange, yRange: rangeOf(errors.map(within), { about: 0, least: 0.5 }),
    lines: errors.map((y, i) => ({ from: 0, step, y, colour: colours[i], dot: colours[i] === "--now" ? "now" : "grey" })),
  });
  const torques = [...(kept ? [kept.applied[joint]] : []), now.applied[joint]];
  const limit = data.torque_limit_Nm[joint];
  charts.torque.draw({
    xRange, yRange: rangeOf([...torques, now.friction[joint]].map(within), { least: 0.5 }),
    lines: [
      ...torques.map((y, i) => ({ from: 0, step, y, colour: colours[i], width: 1.2, dot: colours[i] === "--now" ? "drive" : "grey" })),
      { from: 0, step, y: now.friction[joint], colour: "--friction", width: 1.8, dot: "friction" },
    ],
    marks: [limit, -limit].map((y) => ({ y, colour: "--bad", text: "limit" })),
  });
  const reference = references[joint].map((q8) => q8 / 256 * data.rad_per_count[joint] * DEG);
  charts.motion.draw({
    xRange, yRange: rangeOf([within(reference)], { least: 0.02 }),
    lines: [
      { from: 0, step, y: now.position[joint], colour: "--now", width: 2, dot: "joint" },
      { from: 0, step, y: reference, colour: "--ink", dash: [4, 4], dot: "reference" },
    ],
  });
}

/* --- Error dynamics ------------------------------------------------------------------------ */

function split(pairs) {
  const [e, rate] = [new Float64Array(pairs.length / 2), new Float64Array(pairs.length / 2)];
  for (let i = 0; i < e.length; i++) { [e[i], rate[i]] = [pairs[2 * i], pairs[2 * i + 1]]; }
  return { e, rate };
}

/* The kept gains change less often than those of the sliders. */
let keptOne = {};
function keptFlow(flow) {
  const { gains } = shown.kept, from = state.start.join();
  if (keptOne.gains !== gains || keptOne.from !== from) { keptOne = { gains, from, flow: flow(gains) }; }
  return keptOne.flow;
}

function showDynamics() {
  const { gains } = state;
  const kind = classOf(gains.alpha, gains.beta);
  const origin = originOf(gains.kd, gains.kp, gains.alpha, gains.beta);
  byId("class").textContent = data.classes[kind][0];
  byId("class-more").textContent = data.classes[kind][1];
  byId("origin").textContent = origin;
  const homogeneous = same(gains.beta, finiteTimeBeta(gains.alpha));
  byId("origin-more").textContent = homogeneous
    ? `node from KD = ${criticalDamping(gains.kp, gains.alpha).toPrecision(3)} on`
    : `by the exponents alone, at any gains: β is ${origin === "focus" ? "below" : "above"} α/(2 − α)`;

  /* The speed that the stiffness gives on the way from 1 rad to 0, and some more. */
  const fast = 1.2 * Math.sqrt(2 * value(gains.kp) / (value(gains.beta) + 1));
  const starts = [[1, 0], [1, -fast], [0.4, -fast], [-0.2, -fast], [-0.7, -fast]];
  const lines = [];
  for (const start of starts) {
    const { e, rate } = split(robot.flow(gains, start, FLOW.stepS, FLOW.steps, FLOW.rows));
    lines.push({ x: e, y: rate, colour: "--now", width: 1.1, arrow: 0.12 });
    lines.push({ x: e.map((one) => -one), y: rate.map((one) => -one), colour: "--now", width: 1.1, arrow: 0.12 });
  }
  const flow = (of) => split(robot.flow(of, state.start, SETTLING.stepS, SETTLING.steps, SETTLING.rows));
  const own = flow(gains);
  lines.push({ x: own.e, y: own.rate, colour: "--start", width: 2.2, arrow: 0.12 });
  charts.phase.draw({
    xRange: [-1.35, 1.35], yRange: [-1.125 * fast, 1.125 * fast], lines,
    marks: [{ x: state.start[0], y: state.start[1], colour: "--start" }],
  });

  const step = SETTLING.stepS * SETTLING.steps;
  const line = (one, colour, width) => ({ from: 0, step, y: one.e.map(Math.abs), colour, width });
  const before = shown.kept ? [line(keptFlow(flow), "--kept", 1.4)] : [];
  charts.settle.draw({
    xRange: [0, step * (SETTLING.rows - 1)], yRange: [LEAST_RAD, 3],
    lines: [...before, line(own, "--start", 2)],
    marks: [{ y: data.resolution_rad, colour: "--muted", text: "one encoder count" }],
  });
}

/* --- The page ------------------------------------------------------------------------------ */

function link(...linked) {
  for (const chart of linked) {
    const leave = () => {
      for (const other of linked) { other.cursor = null; other.redraw(); other.reading.hidden = true; }
    };
    chart.canvas.addEventListener("pointerleave", leave);
    chart.canvas.addEventListener("pointermove", (event) => {
      const [time] = chart.at(event), step = data.arguments.sample_time_s;
      for (const other of linked) {
        other.cursor = time;
        other.redraw();
        other.reading.hidden = other !== chart;
        other.reading.textContent = [`${time.toFixed(3)} s`, ...other.shown.lines.map(({ y, dot }) => {
          const read = y[Math.round(time / step)];
          return `${dot} ${read === undefined ? "–" : minus(read.toPrecision(3))}`;
        })].join(", ");
      }
    });
  }
}

function listen() {
  for (const slider of data.sliders) {
    const input = byId(`slider-${slider.name}`);
    input.max = slider.steps;
    input.addEventListener("input", () => moved(slider, Number(input.value)));
  }
  byId("tie").addEventListener("change", (event) => {
    state.tied = event.target.checked;
    if (state.tied) { state.gains.beta = finiteTimeBeta(state.gains.alpha); }
    else { state.gains.beta = placed(data.sliders.find((one) => one.name === "beta"), byId("slider-beta").value); }
    refresh();
  });
  for (const button of document.querySelectorAll("[data-preset]")) {
    button.addEventListener("click", () => choose(data.presets.find((one) => one.name === button.dataset.preset).gains));
  }
  byId("reset").addEventListener("click", () => {
    state.start = [1, 0];
    choose(data.presets.find((one) => one.name === data.first).gains);
  });
  byId("keep").addEventListener("click", () => { keep(shown.now, "kept"); showDynamics(); showFlight(); });
  for (const input of document.querySelectorAll("input[type=radio]")) {
    input.addEventListener("change", () => {
      if (input.name === "tab") { byId("stage").dataset.tab = input.value; return; }
      state[input.name] = input.name === "joint" ? Number(input.value) : input.value;
      showSliders();
      if (shown.now) { showFlight(); }
    });
  }
  const phase = charts.phase.canvas;
  const aim = (event) => { state.start = charts.phase.at(event); showDynamics(); };
  phase.addEventListener("pointerdown", (event) => { phase.setPointerCapture(event.pointerId); aim(event); });
  phase.addEventListener("pointermove", (event) => { if (phase.hasPointerCapture(event.pointerId)) { aim(event); } });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const chart of Object.values(charts)) { chart.redraw(); }
  });
}

function keep(flight, name) {
  shown.kept = flight;
  for (const one of document.querySelectorAll(".kept-name")) { one.textContent = name; }
}

/* When all flights that were asked for have been flown and drawn. */
async function settled() { while (running) { await running; } }

function proved(flight) {
  const answers = JSON.parse(byId("recorded").textContent).map((recorded) => ({ ...repeat(recorded), says: recorded.says }));
  answers.push({ name: "robot and controller", says: "the first flight of this page", ...sameTorque(flight, bytesOf(byId("first-torque").textContent)) });
  const rows = answers.map(({ name, ticks, different, says }) => {
    const row = document.createElement("tr");
    for (const [kind, text] of [["th", name], ["td", says], ["td", ticks]]) {
      row.append(Object.assign(document.createElement(kind), { textContent: text }));
    }
    row.children[2].className = "number";
    const verdict = different.length ? `no: ${different.length} differ, first at tick ${different[0]}` : "yes, all";
    row.append(Object.assign(document.createElement("td"), { textContent: verdict, className: different.length ? "bad" : "good" }));
    return row;
  });
  byId("proof").tBodies[0].replaceChildren(...rows);
  return answers;
}

async function begin() {
  data = JSON.parse(byId("data").textContent);
  robot = new Robot(bytesOf(byId("wasm").textContent), data);
  const place = robot.module.structures.input.fields.reference_position_q8[1];
  const size = robot.module.sizeOf("input");
  references = data.joint_names.map((_, joint) => Float64Array.from({ length: robot.ticks }, (_, k) =>
    robot.module.view("i32", robot.inputs + k * size + place, robot.joints)[joint]));
  charts = {
    error: new Chart(byId("error"), { x: "time [s]", y: "e [10⁻³ deg]" }),
    torque: new Chart(byId("torque"), { x: "time [s]", y: "τ [N m]" }),
    motion: new Chart(byId("motion"), { x: "time [s]", y: "q [deg]" }),
    phase: new Chart(byId("phase"), { x: "e [rad]", y: "ė [rad/s]" }),
    settle: new Chart(byId("settle"), { x: "time [s]", y: "|e| [rad]", log: true }),
  };
  for (const chart of Object.values(charts)) { chart.reading = chart.canvas.parentElement.querySelector(".reading"); }
  const [first, grey] = [data.first, data.compared].map((name) => data.presets.find((one) => one.name === name));
  keep(measured(await robot.fly(grey.gains, pause), grey.gains), grey.title);
  const flight = await robot.fly(first.gains, pause);
  listen();
  link(charts.error, charts.torque, charts.motion);
  choose(first.gains);
  await settled();
  return { answers: proved(flight) };
}

let playground;
if (typeof WebAssembly === "object") {
  playground = begin();
  playground.catch((error) => fatal(`This page could not start: ${error.message}. A browser of 2023 or later should do.`));
} else {
  fatal("This page runs compiled C, and this browser has no WebAssembly, or has it switched off. Any browser of 2023 or later has it.");
}

function fatal(text) {
  byId("fatal").textContent = text;
  byId("fatal").hidden = false;
  byId("main").hidden = byId("more").hidden = true;
}
