/* The leaderboard as a table that can be sorted and filtered; rows and columns are those of its data. */
"use strict";
(() => {
  const { element, choices, list, breakable, ready, cued } = flexarm;
  const OVERVIEW = "overview";
  const SVG = "http://www.w3.org/2000/svg";
  let board;
  flexarm.board = (data) => { board = data; };

  const state = { view: OVERVIEW, lap: 0, figure: "", barred: new Set(), text: "", sort: 1, down: false, marked: null };
  const NONE = { rank: 2, text: "–", title: "not applicable" };

  /** Return the figures of a column's point, and which of them is shown: the one that is chosen, else the headline. */
  function figures(column, point) {
    const all = board.tasks[board.columns[column].tasks[point]].figures;
    return { all, shown: all[state.figure] ? state.figure : Object.keys(all)[0] };
  }

  /** Return a lap's figure at a point of a row: its mean, or how many laps were lost, or why there is none. */
  function cell(row, column, point, lap = state.lap) {
    const laps = row.columns[column] && row.columns[column][point];
    if (!laps) return NONE;
    const found = laps[Math.min(lap, laps.length - 1)];
    const { all, shown } = figures(column, point);
    const [lost, episodes, value] = [found.lost, found.episodes, found[shown]];
    if (lost) {
      const title = `${lost} of ${episodes} laps lost, the first at ${found.first_loss.toFixed(2)} s`;
      return { rank: lost / episodes, text: lost === episodes ? "lost" : `${lost} of ${episodes} lost`, title };
    }
    if (value === null) return NONE;
    return { rank: 0, value, text: amount(value, all[shown].unit), title: written(value, all[shown].unit), unit: all[shown].unit };
  }

  const millimetres = (metres) => (1000 * metres).toFixed(metres < 0.09995 ? 1 : 0);
  const amount = (value, unit) => (unit === "m" ? millimetres(value) : value.toPrecision(3));
  const written = (value, unit) => `${amount(value, unit)} ${unit === "m" ? "mm" : unit}`;

  /** Return the columns of the view: a heading and what a row has there. */
  function columns() {
    if (state.view === OVERVIEW) {
      const found = [{ head: "rank", at: placed, plain: true }];
      if (board.columns.unknown) {
        found.push({ head: "unknown arms\nlost", at: lostShare, plain: true });
        found.push({ head: "unknown arms\nmedian", at: (row) => quantile(row, "unknown", "median") });
        found.push({ head: "unknown arms\n90th percentile", at: (row) => quantile(row, "unknown", "p90") });
      }
      board.best.forEach(({ head, laps }, n) => laps.forEach((lap, k) => {
        found.push({ head: `${head}\nover the plan, ${lap}`, at: (row) => over(row.over[n][k]), plain: true });
      }));
      return found;
    }
    const column = board.columns[state.view];
    const unit = column.unit && column.unit !== "1" ? `\n${column.unit}` : "";
    const values = column.sample ? ["all episodes"] : column.values;
    const found = values.map((value, n) => ({
      head: `${value}${unit}`, nominal: value === column.nominal, at: (row) => cell(row, state.view, n),
    }));
    return found.length > 1 ? [{ head: "whole\naxis", at: overall }, ...found] : found;
  }

  /** Return what a row does along the whole axis of the view: at how many points a lap is lost, else the largest figure. */
  function overall(row) {
    const cells = board.columns[state.view].values.map((_, n) => cell(row, state.view, n)).filter((one) => one.rank < 2);
    if (!cells.length) return NONE;
    const kept = cells.filter((one) => !one.rank);
    const lost = cells.length - kept.length;
    if (lost) return { rank: lost / (cells.length + 1), text: `lost: ${lost}`, title: `laps are lost at ${lost} of ${cells.length} points` };
    const worst = kept.reduce((most, one) => (one.value > most.value ? one : most));
    return { ...worst, title: "largest on the axis" };
  }

  function placed(row) {
    return row.place === null ? { rank: 2, text: "–", title: "without a rank" } : { rank: 0, value: row.place, text: `${row.place}`, title: "rank" };
  }

  /** Return a quantile of a whole column; infinite where too many laps are lost. */
  function quantile(row, column, what) {
    const whole = row.whole[column];
    if (!whole) return NONE;
    if (whole[what] === null) return { rank: 1, value: whole.lost / whole.episodes, text: "lost", title: `${whole.lost} of ${whole.episodes} lost` };
    const unit = Object.values(board.tasks[board.columns[column].tasks[0]].figures)[0].unit;
    return { rank: 0, value: whole[what], text: amount(whole[what], unit), title: written(whole[what], unit), unit };
  }

  function over(value) {
    if (value === null) return { rank: 1, text: "lost", title: "no error" };
    return { rank: 0, value, text: (1000 * value).toFixed(2), title: "error less that of the best plan known, in mm" };
  }

  // A half goes to the even digit, as in the pages' tables, which Python writes.
  function percent(lost, all) {
    const tenths = (1000 * lost) / all;
    const even = 2 * Math.round(tenths / 2);
    return ((Math.abs(tenths - even) === 0.5 ? even : Math.round(tenths)) / 10).toFixed(1);
  }

  function lostShare(row) {
    const whole = row.whole.unknown;
    if (!whole) return NONE;
    const [low, high] = whole.loss_interval.map((end) => (100 * end).toFixed(1));
    const title = `${whole.lost} of ${whole.episodes}; with 95 % confidence ${low} to ${high} %`;
    return { rank: 0, value: whole.lost / whole.episodes, text: `${percent(whole.lost, whole.episodes)} %`, title };
  }

  /** Return the rows that the filters leave, in the order that is asked for; privileged ones, without a rank, come last. */
  function rows(shown) {
    const wanted = state.text.trim().toLowerCase();
    const left = board.rows.filter(
      (row) => row.name.toLowerCase().includes(wanted) && !row.reads.some((one) => state.barred.has(one)),
    );
    const sign = state.down ? -1 : 1;
    const column = shown[state.sort - 1];
    const byName = (a, b) => a.name.localeCompare(b.name);
    const byRank = (a, b) => (a.place === null) - (b.place === null);
    if (!column) return left.sort((a, b) => sign * byName(a, b));
    const keys = new Map(left.map((row) => [row, column.at(row)]));
    return left.sort((a, b) => {
      const [one, other] = [keys.get(a), keys.get(b)];
      return byRank(a, b) || one.rank - other.rank || sign * ((one.value || 0) - (other.value || 0)) || byName(a, b);
    });
  }

  function heading(text, n, more = "") {
    const sorted = state.sort === n ? (state.down ? "descending" : "ascending") : "none";
    const turn = () => {
      state.down = state.sort === n && !state.down;
      state.sort = n;
      draw();
      parts.table.querySelectorAll("thead button")[n].focus();
    };
    return element("th", { scope: "col", class: more || null, "aria-sort": sorted }, element("button", { type: "button", onclick: turn }, text));
  }

  /** Return a background for an error: none at a centimetre, full at a metre. */
  function heat(value) {
    const share = Math.min(1, Math.max(0, Math.log10(value / 0.01) / 2));
    return `background-color: color-mix(in srgb, var(--fx-heat) ${Math.round(55 * share)}%, transparent)`;
  }

  function line(row, shown) {
    const name = element("th", { scope: "row", class: "fx-name" }, breakable(`${row.name}${row.privileged ? " *" : ""}${row.limited ? "" : " †"}`));
    const reads = element("div", { class: "fx-reads" }, row.reads.join(", ") || "reads nothing");
    name.append(reads);
    if (row.replay) {
      name.append(element("a", { class: "fx-play", href: `${board.replays}#${encodeURIComponent(row.name)}` }, "▶ replay"));
    }
    const cells = shown.map((column) => {
      const one = column.at(row);
      const tinted = one.rank === 0 && one.unit === "m" && !column.plain ? heat(one.value) : null;
      return element("td", { title: one.title, style: tinted, class: one.rank ? "fx-gone" : null }, one.text);
    });
    const mark = (on) => () => { state.marked = on ? row.name : null; marks(); };
    return element(
      "tr",
      { "data-row": row.name, onmouseenter: mark(true), onmouseleave: mark(false), onfocusin: mark(true), onfocusout: mark(false) },
      name, ...cells,
    );
  }

  const parts = {};
  function draw() {
    const shown = columns();
    if (state.sort > shown.length) state.sort = 1;
    const found = rows(shown);
    const heads = shown.map((column, n) => heading(column.head, n + 1, column.nominal ? "fx-nominal" : ""));
    parts.table.replaceChildren(
      element("caption", { class: "fx-hint", style: "caption-side: bottom; text-align: left; padding: 0.4rem 0.6rem" }, caption()),
      element("thead", {}, element("tr", {}, heading("entry", 0, "fx-name"), ...heads)),
      element("tbody", {}, ...found.map((row) => line(row, shown))),
    );
    parts.count.textContent = `${found.length} of ${board.rows.length} entries`;
    for (const part of [parts.lap, parts.figure]) part.hidden = state.view === OVERVIEW;
    parts.chart.replaceChildren(...chart(found));
    marks();
  }

  function caption() {
    const marks = "*: reads the true state; †: without a limit of torque; both have no rank.";
    if (state.view === OVERVIEW) return `Errors of the true tip in mm. A lost lap is infinite: "lost" where the quantile is. ${marks}`;
    const column = board.columns[state.view];
    const { all, shown } = figures(state.view, 0);
    const nominal = column.values.includes(column.nominal) ? " The column with a bar on top is nominal." : "";
    return `${all[shown].text} [${all[shown].unit === "m" ? "mm" : all[shown].unit}], mean of the laps. ${marks}${nominal}`;
  }

  function marks() {
    for (const one of document.querySelectorAll("#flexarm-leaderboard [data-row]")) {
      one.classList.toggle("fx-marked", one.dataset.row === state.marked);
    }
  }

  // --- the chart of an axis of numbers ---

  function drawn(tag, attributes, ...children) {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  }

  const LABELLED = 6; // rows
  const ERRORS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2]; // [m], of the chart's lines across
  const [TALL, LEFT, TOP, BOTTOM, LINE] = [320, 46, 12, 36, 13]; // [px]
  const LETTER = 7.4; // [px], width of a letter of a name

  /** Return the chart of the view's axis: the first rows of the table in colours and with their names, the others in grey. */
  function chart(found) {
    if (state.view === OVERVIEW) return parallel(found);
    const column = board.columns[state.view];
    if (typeof column.values[0] !== "number" || figures(state.view, 0).all[figures(state.view, 0).shown].unit !== "m") return [];
    const width = Math.max(320, parts.chart.clientWidth);
    const [least, most] = [Math.min(...column.values), Math.max(...column.values)];
    const [low, high] = [ERRORS[0], ERRORS[ERRORS.length - 1]];
    const right = beforeNames(found, width);
    const x = (value) => LEFT + ((value - least) / (most - least)) * (right - LEFT);
    const y = (error) => TALL - BOTTOM - (Math.log(Math.min(high, Math.max(low, error)) / low) / Math.log(high / low)) * (TALL - BOTTOM - TOP);
    const unit = column.unit && column.unit !== "1" ? ` [${column.unit}]` : "";
    const picture = drawn("svg", { class: "fx-chart", viewBox: `0 0 ${width} ${TALL}`, role: "img", "aria-label": `Errors of the entries along ${column.title}; the table below has the figures` });
    for (const error of ERRORS) {
      picture.append(drawn("line", { class: "fx-axis", x1: LEFT, x2: right, y1: y(error), y2: y(error) }));
      picture.append(drawn("text", { x: LEFT - 6, y: y(error) + 4, "text-anchor": "end" }, `${1000 * error}`));
    }
    const step = Math.ceil((column.values.length * 36) / (right - LEFT));
    column.values.filter((_, n) => n % step === 0).forEach((value) => {
      picture.append(drawn("text", { x: x(value), y: TALL - BOTTOM + 16, "text-anchor": "middle" }, `${value}`));
    });
    picture.append(drawn("text", { x: (LEFT + right) / 2, y: TALL - 4, "text-anchor": "middle" }, `${column.title}${unit}; errors in mm`));
    if (typeof column.nominal === "number") {
      picture.append(drawn("line", { class: "fx-here", x1: x(column.nominal), x2: x(column.nominal), y1: TOP, y2: TALL - BOTTOM }));
    }
    const curves = found.map((row, n) => curve(row, column, x, y, n < LABELLED ? ` fx-curve-${n}` : ""));
    picture.append(...curves.map((one) => one.group).reverse()); // the first rows on top
    label(curves.slice(0, LABELLED), right);
    label(curves.slice(LABELLED), right);
    const names = `Labelled: the first ${Math.min(LABELLED, found.length)} rows of the table; point at another one to see it. ×: beyond this point laps are lost. Whole axis: at how many points laps are lost, else the largest error.`;
    return [picture, element("p", { class: "fx-hint" }, names)];
  }

  /** Return the line of a row, and where it ends. */
  function curve(row, column, x, y, style) {
    const group = drawn("g", { "data-row": row.name, class: `fx-curve${style}` }, drawn("title", {}, row.name));
    const cells = column.values.map((_, n) => cell(row, state.view, n));
    const lost = (n) => cells[n] && cells[n].rank > 0 && cells[n].rank < 2;
    let [path, last] = ["", null];
    cells.forEach((one, n) => {
      if (one.rank) return;
      const at = [x(column.values[n]).toFixed(1), y(one.value).toFixed(1)];
      path += `${n && !cells[n - 1].rank ? "L" : "M"}${at.join(" ")}`;
      if (lost(n - 1) || lost(n + 1)) group.append(drawn("text", { class: "fx-cross", x: at[0], y: Number(at[1]) + 4, "text-anchor": "middle" }, "×"));
      else group.append(drawn("circle", { cx: at[0], cy: at[1], r: 2.2 }));
      last = at.map(Number);
    });
    return finished(group, row, path, last);
  }

  function finished(group, row, path, last) {
    if (path) group.prepend(drawn("path", { d: path }));
    const mark = (name) => () => { state.marked = name; marks(); };
    group.addEventListener("mouseenter", mark(row.name));
    group.addEventListener("mouseleave", mark(null));
    return { name: row.name, group, last };
  }

  /** Return a plot of all columns beside each other: the 90th percentile of each, on a scale of its own; lost is on top. */
  function parallel(found) {
    const names = Object.keys(board.columns).filter((name) => name !== "nominal" && found.some((row) => row.whole[name]));
    if (names.length < 2) return [];
    const width = Math.max(320, parts.chart.clientWidth);
    const [left, right] = [84, beforeNames(found, width)];
    const [tall, bottom, top] = [TALL + 135, 175, TOP + 26];
    const picture = drawn("svg", { class: "fx-chart", viewBox: `0 0 ${width} ${tall}`, role: "img", "aria-label": "90th percentile of the entries in every column; each column's table has the figures" });
    picture.append(drawn("text", { x: left - 8, y: TOP + 4, "text-anchor": "end" }, "lost"));
    const numbers = [];
    const axes = names.map((name, n) => {
      const x = left + (n / (names.length - 1)) * (right - left);
      const cells = new Map(found.map((row) => [row.name, quantile(row, name, "p90")]));
      const values = [...cells.values()].filter((one) => one.rank === 0).map((one) => one.value);
      const [low, high] = [Math.min(...values), Math.max(...values)];
      const share = (value) => (high > low ? Math.log(value / low) / Math.log(high / low) : 0);
      const y = (one) => (one.rank ? TOP : tall - bottom - share(one.value) * (tall - bottom - top));
      picture.append(drawn("line", { class: "fx-axis", x1: x, x2: x, y1: TOP, y2: tall - bottom }));
      const unit = Object.values(board.tasks[board.columns[name].tasks[0]].figures)[0].unit;
      for (const [value, at] of values.length ? [[high, top - 4], [low, tall - bottom + 13]] : []) {
        numbers.push(drawn("text", { class: "fx-number", x, y: at, "text-anchor": "middle" }, amount(value, unit)));
      }
      const [tx, ty] = [x, tall - bottom + 26];
      picture.append(drawn("text", { x: tx, y: ty, "text-anchor": "end", transform: `rotate(-30 ${tx} ${ty})` }, board.columns[name].title));
      return { x, y, cells };
    });
    const curves = found.map((row, n) => {
      const group = drawn("g", { "data-row": row.name, class: `fx-curve${n < LABELLED ? ` fx-curve-${n}` : ""}` }, drawn("title", {}, row.name));
      let [path, last] = ["", null];
      axes.forEach(({ x, y, cells }, k) => {
        const one = cells.get(row.name);
        if (one.rank === 2) return;
        const gap = k === 0 || axes[k - 1].cells.get(row.name).rank === 2;
        last = [x, y(one)];
        path += `${gap ? "M" : "L"}${last[0].toFixed(1)} ${last[1].toFixed(1)}`;
        group.append(drawn("circle", { cx: last[0], cy: last[1], r: 2.2 }));
      });
      return finished(group, row, path, last);
    });
    picture.append(...curves.map((one) => one.group).reverse(), ...numbers); // numbers are readable across lines
    label(curves.slice(0, LABELLED), right, tall - bottom);
    label(curves.slice(LABELLED), right, tall - bottom);
    const hint = "The 90th percentile of each column, the least and the largest written at its ends, logarithmic between; on top more than a tenth of the laps are lost. Labelled: the first rows of the table; point at another one to see it.";
    return [picture, element("p", { class: "fx-hint" }, hint)];
  }

  /** Return where the margin begins that has room for the rows' names, but for half of the width at most. */
  function beforeNames(found, width) {
    return width - Math.min(16 + LETTER * Math.max(0, ...found.map((row) => row.name.length)), width / 2);
  }

  /** Write the names of lines into the margin, each beside its line's end, or as near as the others leave room. */
  function label(curves, right, lowest = TALL - BOTTOM) {
    const named = curves.filter((one) => one.last).sort((a, b) => a.last[1] - b.last[1]);
    let free = TOP;
    const heights = named.map((one) => { free = Math.max(free, one.last[1]) + LINE; return free - LINE; });
    let most = lowest;
    for (let n = named.length - 1; n >= 0; n--) { heights[n] = Math.min(heights[n], most); most = heights[n] - LINE; }
    named.forEach(({ name, group, last }, n) => {
      group.append(drawn("path", { class: "fx-leader", d: `M${last[0] + 4} ${last[1]}L${right + 8} ${heights[n]}` }));
      group.append(drawn("text", { class: "fx-label", x: right + 12, y: heights[n] + 4 }, name));
    });
  }

  // --- controls ---

  function toggles() {
    const readings = board.readings.map((name) => {
      const input = element("input", { type: "checkbox", name: "reads", value: name, checked: true });
      input.addEventListener("change", () => {
        if (input.checked) state.barred.delete(name);
        else state.barred.add(name);
        draw();
      });
      return element("label", {}, input, element("span", {}, name));
    });
    return element("fieldset", { class: "fx-toggles" }, element("legend", {}, "An entry may read"), ...readings);
  }

  ready(() => {
    const mount = document.getElementById("flexarm-leaderboard");
    if (!mount || !board) return;
    const views = [[OVERVIEW, "Overview"], ...Object.entries(board.columns).map(([name, one]) => [name, one.title])];
    const search = element("input", { type: "search", placeholder: "lqg, agent, …" });
    search.addEventListener("input", () => { state.text = search.value; draw(); });
    const change = (name) => (value) => { state[name] = value; draw(); };
    parts.lap = choices("Lap", "board-lap", board.laps.map((lap, n) => [String(n), lap]), "0", (value) => change("lap")(Number(value)));
    const titles = Object.values(board.tasks).flatMap((task) => Object.entries(task.figures).map(([name, one]) => [name, one.title]));
    parts.figure = list("Figure", [["", "headline"], ...new Map(titles)], state.figure, change("figure"));
    parts.count = element("span", { class: "fx-hint", role: "status" });
    parts.chart = element("div");
    parts.table = element("table", { class: "fx-board" });
    const turn = (value) => { state.view = value; state.sort = 1; state.down = false; draw(); };
    mount.replaceChildren(
      element(
        "div", { class: "fx-controls" },
        list("Axis", views, state.view, turn), parts.lap, parts.figure,
        element("label", { class: "fx-list" }, element("span", {}, "Name"), search),
      ),
      element("div", { class: "fx-controls" }, toggles(), parts.count),
      parts.chart,
      element("div", { class: "fx-scroll", tabindex: 0, role: "region", "aria-label": "Leaderboard" }, parts.table),
    );
    draw();
    let width = parts.chart.clientWidth;
    new ResizeObserver(() => {
      if (parts.chart.clientWidth === width) return;
      width = parts.chart.clientWidth;
      draw();
    }).observe(mount);
    cued(mount.querySelector(".fx-scroll"));
  });
})();
