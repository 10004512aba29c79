/* The replay viewer: two controllers on the same lap, side by side in time. scripts/docs/replays.py makes its data. */
"use strict";
(() => {
  const { element, choices, list, breakable, colours, onTheme, fitted, load, ready } = flexarm;
  const NOBODY = "";
  const REACH = 9.3; // of the picture's middle to its rim [m]
  const CLOSE = 0.9; // half the width of the close-up [m]
  const TRAIL = 2.5; // [s]
  const CALM = 0.25; // between pictures for who wants no motion [s]
  const BEGIN = 0.3; // [s]; until then arms that start alike cover each other

  // --- data ---

  let index;
  const laps = new Map(); // by "row|lap"
  flexarm.replays = (value) => { index = value; };
  flexarm.replay = (row, lap, value) => laps.set(`${row}|${lap}`, decoded(value));

  const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

  /** Return whole numbers of 5 bits a digit, the lowest first, of which the lowest is the sign; 32: more follow. */
  function numbers(text) {
    const found = [];
    let [value, place] = [0, 1];
    for (const letter of text) {
      const digit = DIGITS.indexOf(letter);
      value += (digit % 32) * place;
      place *= 32;
      if (digit >= 32) continue;
      found.push(value % 2 ? (1 - value) / 2 : value / 2);
      [value, place] = [0, 1];
    }
    return found;
  }

  /** Return the sequences that scripts.docs.replays.packed wrote as second differences. */
  function unpacked(data) {
    return data.map((text) => {
      const values = Float64Array.from(numbers(text));
      for (let k = 0; k < 2; k++) for (let n = 1; n < values.length; n++) values[n] += values[n - 1];
      return values;
    });
  }

  function decoded(value) {
    const found = { interval: value.interval, instants: value.instants, ended: value.ended };
    const sequences = unpacked(value.data);
    for (const [name, count, step] of value.channels) {
      found[name] = sequences.splice(0, count).map((sequence) => sequence.map((one) => one * step));
    }
    found.tip = [new Float64Array(value.instants), new Float64Array(value.instants)];
    for (let n = 0; n < value.instants; n++) {
      const points = shape(found, n, 1);
      [found.tip[0][n], found.tip[1][n]] = points[1][points[1].length - 1];
    }
    found.deflection = index.links.map((link, k) => {
      const point = link.points[link.points.length - 1];
      return Float64Array.from({ length: value.instants }, (_, n) => bent(point, modal(found, n, k))[1]);
    });
    const [x, y] = found.reference;
    found.error = found.tip[0].map((one, n) => Math.hypot(one - x[n], found.tip[1][n] - y[n]));
    return found;
  }

  // --- where the arm is (flexarm_env.physics.bent_link) ---

  const modal = (lap, n, link) => {
    const half = lap.modal.length / 2;
    return lap.modal.slice(link * half, (link + 1) * half).map((sequence) => sequence[n]);
  };

  /** Return a point of a link, along and across its root tangent [m]. */
  function bent(point, q) {
    const m = q.length;
    let [across, square, k] = [0, 0, 1 + m];
    for (let i = 0; i < m; i++) {
      across += point[1 + i] * q[i];
      for (let j = 0; j <= i && k < point.length; j++, k++) square += (i === j ? 1 : 2) * point[k] * q[i] * q[j];
    }
    return [point[0] - square / 2, across];
  }

  /** Return points of both links at an instant [m]; with `every` = 1 only their ends. */
  function shape(lap, n, every = 0) {
    let [root, angle] = [[0, 0], lap.joints[0][n]];
    return index.links.map((link, k) => {
      const q = modal(lap, n, k);
      if (k) angle += lap.joints[1][n];
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      const [x0, y0] = root;
      const wanted = every ? link.points.slice(-1) : link.points;
      const points = wanted.map((point) => {
        const [along, across] = bent(point, q);
        return [x0 + along * cos - across * sin, y0 + along * sin + across * cos];
      });
      link.slopes.forEach((slope, i) => { angle += slope * q[i]; });
      root = points[points.length - 1];
      return points;
    });
  }

  /** Return points of both links of a row's lap that was loaded, for whoever wants them. */
  flexarm.linkPoints = (row, lap, n) => shape(laps.get(`${row}|${lap}`), n);

  /** Return the number of the instant of a time; a lap that ended early stays where it ended. */
  const instant = (lap, time) => Math.min(lap.instants - 1, Math.round(time / lap.interval));

  const rms = (values) => Math.sqrt(values.reduce((sum, one) => sum + one * one, 0) / values.length);

  // --- the viewer ---

  const state = { rows: ["", ""], lap: "swing", time: BEGIN, playing: false, speed: 1, small: false };
  const parts = {};
  let shown = [null, null]; // laps
  let colour, traces;

  /** Offer the controllers that have such a lap; those that have none make room for others. */
  function offer() {
    const names = index.rows.filter((row) => row.files[state.lap]).map((row) => row.name);
    const free = names.filter((name) => !state.rows.includes(name));
    state.rows = state.rows.map((name) => (name === NOBODY || names.includes(name) ? name : free.shift()));
    const pairs = names.map((name) => [name, name]);
    const pick = (n) => (name) => { state.rows[n] = name; choose(); };
    parts.lists.replaceChildren(
      list("First controller", pairs, state.rows[0], pick(0)),
      list("Second controller", [...pairs, [NOBODY, "nobody"]], state.rows[1], pick(1)),
    );
    return choose();
  }

  async function choose() {
    parts.error.textContent = "";
    try {
      for (const row of state.rows) {
        if (row === NOBODY || laps.has(`${row}|${state.lap}`)) continue;
        await load(parts.mount.dataset.files + index.rows.find((one) => one.name === row).files[state.lap]);
      }
    } catch (error) {
      parts.error.textContent = error.message;
    }
    shown = state.rows.map((row) => laps.get(`${row}|${state.lap}`) || null);
    describe();
    traces = null;
    state.time = Math.min(state.time, end());
    parts.slider.max = end();
    draw();
  }

  const end = () => Math.max(0.01, ...shown.map((lap) => (lap ? (lap.instants - 1) * lap.interval : 0)));

  function describe() {
    const told = state.rows.flatMap((name) => {
      const row = index.rows.find((one) => one.name === name);
      if (!row) return [];
      const reads = `reads ${row.reads.join(", ") || "nothing"}${row.privileged ? "; privileged" : ""}`;
      return [element("dt", {}, name), element("dd", {}, `${row.text}; ${reads}`)];
    });
    parts.who.replaceChildren(...told);
    parts.told.textContent = `The lap "${state.lap}": ${index.laps[state.lap].text}.`;
    const heads = state.rows.map((name) => element("th", { scope: "col" }, breakable(name)));
    parts.heads.replaceChildren(element("th", {}), ...heads);
  }

  // --- pictures ---

  const AB = ["a", "b"];

  function path(context, points, at) {
    context.beginPath();
    points.forEach((point, n) => context[n ? "lineTo" : "moveTo"](...at(point)));
    context.stroke();
  }

  function square(context, at) {
    context.strokeStyle = colour("path");
    context.lineWidth = 1.5;
    for (const { reference: [x, y] } of shown.filter(Boolean)) path(context, Array.from(x, (one, n) => [one, y[n]]), at);
  }

  function trail(context, lap, now, at) {
    const first = Math.max(0, now - Math.round(TRAIL / lap.interval));
    const parts = 10;
    for (let part = 0; part < parts; part++) {
      const [from, to] = [part, part + 1].map((one) => first + Math.round((one * (now - first)) / parts));
      if (to <= from) continue;
      context.globalAlpha = 0.15 + (0.75 * part) / parts;
      const points = [];
      for (let n = from; n <= to; n++) points.push([lap.tip[0][n], lap.tip[1][n]]);
      path(context, points, at);
    }
    context.globalAlpha = 1;
  }

  const reference = (lap, now) => [lap.reference[0][now], lap.reference[1][now]];

  function target(context, lap, now, at, size) {
    const [x, y] = at(reference(lap, now));
    context.strokeStyle = colour("target");
    context.lineWidth = 2;
    context.beginPath();
    context.arc(x, y, size, 0, 2 * Math.PI);
    context.moveTo(x - 1.6 * size, y);
    context.lineTo(x + 1.6 * size, y);
    context.moveTo(x, y - 1.6 * size);
    context.lineTo(x, y + 1.6 * size);
    context.stroke();
  }

  function dot(context, point, at, size) {
    context.beginPath();
    context.arc(...at(point), size, 0, 2 * Math.PI);
    context.fill();
  }

  /** Draw a late reading: a ring. */
  function reading(context, lap, now, at, size) {
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...at([lap.sensed[0][now], lap.sensed[1][now]]), size, 0, 2 * Math.PI);
    context.stroke();
  }

  function arm(context, lap, now, at) {
    const points = shape(lap, now);
    context.lineJoin = context.lineCap = "round";
    // the straight links: what the encoders alone would say
    context.setLineDash([3, 5]);
    context.lineWidth = 1.2;
    const [first, second] = [lap.joints[0][now], lap.joints[0][now] + lap.joints[1][now]];
    const lengths = index.links.map((link) => link.points[link.points.length - 1][0]);
    const elbow = [lengths[0] * Math.cos(first), lengths[0] * Math.sin(first)];
    path(context, [[0, 0], elbow, [elbow[0] + lengths[1] * Math.cos(second), elbow[1] + lengths[1] * Math.sin(second)]], at);
    context.setLineDash([]);
    context.lineWidth = 4;
    path(context, points.flat(), at);
    const joint = points[0][points[0].length - 1];
    for (const [point, size] of [[[0, 0], 6], [joint, 4.5]]) {
      dot(context, point, at, size);
    }
    const outer = context.fillStyle;
    context.fillStyle = colour("panel");
    for (const [point, size] of [[[0, 0], 2.5], [joint, 1.8]]) dot(context, point, at, size);
    context.fillStyle = outer;
    const tip = points[1][points[1].length - 1];
    const [taken, put] = index.laps[state.lap].carried;
    const [x, y] = at(tip);
    if (state.time >= taken && state.time < put) context.fillRect(x - 8, y - 8, 16, 16);
    else dot(context, tip, at, 4.5);
  }

  function each(context, draw) {
    shown.forEach((lap, n) => {
      if (!lap) return;
      context.strokeStyle = context.fillStyle = colour(AB[n]);
      draw(lap, instant(lap, state.time), n);
    });
  }

  function whole() {
    const { context, width, height } = fitted(parts.arm);
    const scale = Math.min(width, height) / 2 / REACH;
    const at = ([x, y]) => [width / 2 + scale * x, height / 2 - scale * y];
    square(context, at);
    context.lineWidth = 2;
    each(context, (lap, now) => trail(context, lap, now, at));
    each(context, (lap, now) => arm(context, lap, now, at));
    each(context, (lap, now) => target(context, lap, now, at, 5));
  }

  function close() {
    const { context, width, height } = fitted(parts.close);
    const first = shown.find(Boolean);
    const [x0, y0] = reference(first, instant(first, state.time));
    const scale = width / 2 / CLOSE;
    const at = ([x, y]) => [width / 2 + scale * (x - x0), height / 2 - scale * (y - y0)];
    square(context, at);
    each(context, (lap, n) => { context.lineWidth = 2; trail(context, lap, n, at); });
    each(context, (lap, n) => {
      context.lineWidth = 3;
      path(context, shape(lap, n)[1], at);
      dot(context, [lap.tip[0][n], lap.tip[1][n]], at, 6);
      reading(context, lap, n, at, 7);
    });
    each(context, (lap, n) => target(context, lap, n, at, 7));
    context.fillStyle = context.strokeStyle = colour("soft");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(12, height - 12);
    context.lineTo(12 + 0.1 * scale, height - 12);
    context.stroke();
    context.font = "11px sans-serif";
    context.fillText("10 cm", 12, height - 18);
  }

  // --- traces ---

  const STRIPS = [
    {
      title: "tip's distance from the reference [mm], logarithmic",
      lines: (lap) => [lap.error.map((one) => Math.log10(Math.max(1, 1000 * one)))],
      powers: true,
    },
    { title: "torques [N m]: shoulder; elbow dashed", lines: (lap) => lap.torque },
    { title: "links' tips off their tangents [m]: link 1; link 2 dashed", lines: (lap) => lap.deflection },
  ];
  const [LEFT, RIGHT, GAP] = [46, 8, 24];

  function span(strip) {
    let [least, most] = [0, 1e-3];
    for (const lap of shown.filter(Boolean)) {
      for (const line of strip.lines(lap)) for (const one of line) [least, most] = [Math.min(least, one), Math.max(most, one)];
    }
    const pad = 0.05 * (most - least);
    return [strip.powers ? 0 : least - pad, most + pad];
  }

  /** Round numbers for an axis, three or four of them. */
  function ticks([least, most], powers) {
    if (powers) return { found: [0, 1, 2, 3].filter((one) => one <= most), text: (one) => `${10 ** one}` };
    const rough = (most - least) / 3;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough * 0.8);
    const found = [];
    for (let n = Math.ceil(least / step); n * step <= most; n++) found.push(n * step);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return { found, text: (one) => one.toFixed(digits) };
  }

  function still(width, height) {
    const made = document.createElement("canvas");
    const ratio = window.devicePixelRatio || 1;
    [made.width, made.height] = [width * ratio, height * ratio];
    const context = made.getContext("2d");
    context.scale(ratio, ratio);
    const tall = (height - 18) / STRIPS.length;
    const x = (time) => LEFT + (time / end()) * (width - LEFT - RIGHT);
    context.font = "11px sans-serif";
    context.lineJoin = "round";
    STRIPS.forEach((strip, n) => {
      const [top, bottom] = [n * tall + GAP, (n + 1) * tall - 4];
      const range = span(strip);
      const y = (value) => bottom - ((value - range[0]) / (range[1] - range[0])) * (bottom - top);
      const { found, text } = ticks(range, strip.powers);
      context.lineWidth = 1;
      for (const value of found) {
        context.strokeStyle = colour("grid");
        context.beginPath();
        context.moveTo(LEFT, y(value));
        context.lineTo(width - RIGHT, y(value));
        context.stroke();
        context.fillStyle = colour("soft");
        context.textAlign = "right";
        context.fillText(text(value), LEFT - 6, y(value) + 4);
      }
      context.textAlign = "left";
      context.fillStyle = colour("text");
      context.fillText(strip.title, LEFT, top - 8);
      shown.forEach((lap, who) => lap && lines(context, strip.lines(lap), AB[who], (time) => x(time), y, lap.interval));
    });
    context.fillStyle = colour("soft");
    context.textAlign = "center";
    for (let time = 0; time <= end() + 1e-9; time += 4) context.fillText(`${time} s`, Math.min(x(time), width - 16), height - 5);
    return made;
  }

  function lines(context, sequences, name, x, y, interval) {
    sequences.forEach((values, which) => {
      context.strokeStyle = colour(name);
      context.globalAlpha = 0.9;
      context.lineWidth = 1.3;
      context.setLineDash(which ? [4, 3] : []);
      context.beginPath();
      values.forEach((value, n) => context[n ? "lineTo" : "moveTo"](x(n * interval), y(value)));
      context.stroke();
    });
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  function strips() {
    const { context, width, height } = fitted(parts.traces);
    if (!traces || traces.size !== `${width} ${height}`) traces = { size: `${width} ${height}`, picture: still(width, height) };
    context.drawImage(traces.picture, 0, 0, width, height);
    const x = LEFT + (state.time / end()) * (width - LEFT - RIGHT);
    context.strokeStyle = colour("target");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, GAP - 6);
    context.lineTo(x, height - 18);
    context.stroke();
  }

  // --- figures ---

  const complete = (lap) => ["truncated", "finished"].includes(lap.ended);
  const FIGURES = [
    ["distance [mm]", (lap, n) => (1000 * lap.error[n]).toFixed(1)],
    ["so far, r.m.s. [mm]", (lap, n) => (1000 * rms(lap.error.slice(0, n + 1))).toFixed(1)],
    ["to the end, r.m.s. [mm]", (lap) => (complete(lap) ? (1000 * rms(lap.error)).toFixed(1) : "lost")],
    ["to the end [s]", (lap) => ((lap.instants - (lap.ended === "truncated")) * lap.interval).toFixed(2)],
    ["torques [N m]", (lap, n) => lap.torque.map((one) => one[n].toFixed(0)).join(" / ")],
    ["deflections [m]", (lap, n) => lap.deflection.map((one) => one[n].toFixed(2)).join(" / ")],
  ];

  function figures() {
    parts.figures.replaceChildren(...FIGURES.map(([title, of]) => {
      const values = shown.map((lap) => element("td", {}, lap ? of(lap, instant(lap, state.time)) : ""));
      return element("tr", {}, element("th", { scope: "row" }, title), ...values);
    }));
  }

  function draw() {
    if (!shown.some(Boolean) || !parts.arm.clientWidth) return; // not laid out: hidden, or another page is being opened
    whole();
    if (!state.small) {
      close();
      strips();
      figures();
    }
    parts.slider.value = state.time;
    const text = `${state.time.toFixed(2)} s`;
    parts.slider.setAttribute("aria-valuetext", text);
    parts.clock.textContent = text;
  }

  // --- time ---

  const calm = matchMedia("(prefers-reduced-motion: reduce)");

  function play(on) {
    state.playing = on;
    parts.play.textContent = on ? "❚❚ Pause" : "▶ Play";
    parts.play.setAttribute("aria-pressed", on);
    if (!on) return;
    if (state.time >= end() - 1e-9) state.time = BEGIN;
    let before = performance.now();
    let [time, last] = [state.time, state.time];
    const step = (now) => {
      if (!state.playing) return;
      time = Math.min(end(), (state.time === last ? time : state.time) + (state.speed * Math.max(0, now - before)) / 1000);
      before = now;
      state.time = last = calm.matches && time < end() ? CALM * Math.floor(time / CALM) : time;
      draw();
      if (time >= end()) play(false);
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  function seek(time) {
    state.time = Math.min(end(), Math.max(0, time));
    draw();
  }

  function keys(event) {
    const own = event.target.matches("select, input[type=radio], a");
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const step = event.shiftKey ? 1 : 0.05;
    const actions = {
      " ": () => play(!state.playing),
      ArrowLeft: () => seek(state.time - step),
      ArrowRight: () => seek(state.time + step),
      Home: () => seek(0),
      End: () => seek(end()),
    };
    const action = actions[event.key];
    if (!action || own || (event.key === " " && event.target.matches("button"))) return;
    event.preventDefault();
    action();
  }

  function scrub(event) {
    if (event.type === "pointermove" && !event.buttons) return;
    const box = parts.traces.getBoundingClientRect();
    seek(((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT)) * end());
  }

  // --- the page ---

  function build(mount) {
    const label = "The arms, the path and the reference; the figures beside it are in the table";
    Object.assign(parts, {
      mount,
      arm: element("canvas", { class: "fx-arm", role: "img", "aria-label": label }),
      close: element("canvas", { class: "fx-close", role: "img", "aria-label": "Close-up of the tips and late readings around the reference" }),
      traces: element("canvas", { role: "img", "aria-label": "Errors, torques and deflections over the lap", onpointerdown: scrub, onpointermove: scrub }),
      slider: element("input", { type: "range", min: 0, max: 16, step: 0.01, value: 0, "aria-label": "Time" }),
      clock: element("output", {}),
      play: element("button", { type: "button", class: "fx-button", "aria-pressed": "false", onclick: () => play(!state.playing) }, "▶ Play"),
      figures: element("tbody"),
      heads: element("tr"),
      lists: element("div", { style: "display: contents" }),
      who: element("dl", { class: "fx-who" }),
      told: element("p", { class: "fx-hint" }),
      error: element("p", { class: "fx-error", role: "alert" }),
    });
    parts.slider.addEventListener("input", () => seek(Number(parts.slider.value)));
    if (state.small) mount.replaceChildren(...few());
    else mount.replaceChildren(...all());
  }

  const speeds = () => list(
    "Speed", ["0.1", "0.25", "0.5", "1", "2"].map((one) => [one, `${one}×`]), String(state.speed),
    (value) => { state.speed = Number(value); },
  );
  const transport = () => element("div", { class: "fx-transport" }, parts.play, parts.slider, parts.clock, speeds());
  const stage = (...others) => element(
    "div", { class: "fx-stage" },
    element("div", {}, parts.arm, element("div", { class: "fx-caption" }, "Dashed: the same joints with straight links. Cross: where the tip should be.")),
    ...others,
  );

  /** Return the parts of a page that is about something else: two arms and the time. */
  function few() {
    return [parts.error, stage(element("div", { class: "fx-side fx-told" }, parts.who, parts.told)), transport()];
  }

  function all() {
    return [
      element(
        "div", { class: "fx-controls" }, parts.lists,
        choices("Lap", "replay-lap", Object.keys(index.laps).map((lap) => [lap, lap]), state.lap, (lap) => { state.lap = lap; offer(); }),
      ),
      parts.error,
      stage(element(
        "div", { class: "fx-side" }, parts.close,
        element("div", { class: "fx-caption" }, "Close-up. Dot: the tip. Ring: where the late sensor says that it is."),
        element("table", { class: "fx-figures" }, element("thead", {}, parts.heads), parts.figures),
      )),
      transport(),
      element("div", { class: "fx-traces" }, parts.traces),
      element("p", { class: "fx-hint" }, element("kbd", {}, "Space"), " plays and pauses, ", element("kbd", {}, "←"), " ", element("kbd", {}, "→"),
        " move by 0.05 s, with ", element("kbd", {}, "Shift"), " by 1 s, ", element("kbd", {}, "Home"), " and ", element("kbd", {}, "End"),
        " go to the ends. Drag in the traces to move through the lap."),
      parts.told, parts.who,
    ];
  }

  ready(() => {
    const mount = document.getElementById("flexarm-replay");
    if (!mount || !index) return;
    const asked = decodeURIComponent(location.hash.slice(1));
    const first = index.rows.find((row) => row.name === asked) || index.rows[0];
    state.rows = [first.name, first.name === "lqg_adaptive" ? "agent square" : "lqg_adaptive"];
    if (!first.files[state.lap]) [state.lap] = Object.keys(first.files);
    if (mount.dataset.small) {
      const [one, other, lap] = mount.dataset.small.split("|");
      Object.assign(state, { rows: [one, other], lap, small: true, speed: 0.25 });
    }
    colour = colours(mount);
    build(mount);
    mount.addEventListener("keydown", keys);
    if (!state.small) document.addEventListener("keydown", (event) => event.target === document.body && keys(event));
    onTheme(() => { traces = null; draw(); });
    new ResizeObserver(() => { if (!state.playing) draw(); }).observe(mount);
    offer().then(() => { if (state.small && !calm.matches) play(true); });
  });
})();
