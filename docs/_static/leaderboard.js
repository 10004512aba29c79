/* The leaderboard as a table that can be sorted and filtered; rows and columns are those of its data. */
"use strict";
(() => {
  const { element, choices, list, breakable, ready, cued } = flexarm;
  const FIGURES = { rms: "whole lap", rms_after_2s: "after 2 s", maximum: "largest distance" };
  const OVERVIEW = "overview";
  const SVG = "http://www.w3.org/2000/svg";
  let board;
  flexarm.board = (data) => { board = data; };

  const state = { view: OVERVIEW, lap: 0, figure: "rms", barred: new Set(), text: "", sort: 2, down: false, marked: null };

  /** Return a lap's figure at a point of a row: a value, or why there is none. A lost lap counts with the limit. */
  function cell(row, column, point, lap = state.lap, figure = state.figure) {
    const laps = row.columns[column] && row.columns[column][point];
    if (!laps) return { rank: 2, text: "–", title: "not applicable" };
    const found = laps[Math.min(lap, laps.length - 1)];
    const [lost, episodes, first] = [found.lost, found.episodes, found.first_loss];
    if (lost === episodes || found[figure] === null) {
      return { rank: 1, text: "lost", title: `lost at ${first.toFixed(2)} s` };
    }
    const value = (lost * board.limit + (episodes - lost) * found[figure]) / episodes;
    const text = millimetres(value);
    if (!lost) return { rank: 0, value, text, title: `${text} mm` };
    const title = `${lost} of ${episodes} laps lost, the first at ${first.toFixed(2)} s; ${millimetres(found[figure])} mm without them`;
    return { rank: 0, value, text: column === "unknown" && state.view === OVERVIEW ? text : `${lost} of ${episodes} lost: ${text}`, title };
  }

  const millimetres = (metres) => (1000 * metres).toFixed(metres < 0.09995 ? 1 : 0);

  /** Return the columns of the view: a heading and what a row has there. */
  function columns() {
    if (state.view === OVERVIEW) {
      const found = [];
      if (board.columns.unknown) {
        found.push({ head: "unknown arms\nlost", at: lostShare, plain: true });
        board.laps.forEach((lap, n) => found.push({ head: `unknown arms\n${lap}`, at: (row) => cell(row, "unknown", 0, n, "rms") }));
        board.laps.forEach((lap, n) => found.push({ head: `completed\n${lap} laps`, at: (row) => completed(row, n) }));
      }
      board.laps.forEach((lap, n) => {
        found.push({ head: `nominal\n${lap}`, at: (row) => cell(row, "nominal", 0, n, "rms") });
        found.push({ head: `${lap}\nafter 2 s`, at: (row) => cell(row, "nominal", 0, n, "rms_after_2s") });
      });
      board.laps.forEach((lap, n) => found.push({ head: `gap\n${lap}`, at: (row) => gap(row, n), plain: true }));
      return found;
    }
    const column = board.columns[state.view];
    const unit = column.unit && column.unit !== "1" ? `\n${column.unit}` : "";
    const values = state.view === "unknown" ? ["all 256 arms"] : column.values;
    const found = values.map((value, n) => ({
      head: `${value}${unit}`, nominal: value === column.nominal, at: (row) => cell(row, state.view, n),
    }));
    return found.length > 1 ? [{ head: "whole\naxis", at: overall }, ...found] : found;
  }

  /** Return what a row does along the whole axis of the view: at how many points the path is lost, else the largest error. */
  function overall(row) {
    const cells = board.columns[state.view].values.map((_, n) => cell(row, state.view, n)).filter((one) => one.rank < 2);
    if (!cells.length) return { rank: 2, text: "–", title: "not applicable" };
    const kept = cells.filter((one) => !one.rank);
    const lost = cells.length - kept.length;
    const value = Math.max(0, ...kept.map((one) => one.value));
    if (lost) return { rank: lost / (cells.length + 1), value, text: `lost: ${lost}`, title: `lost at ${lost} of ${cells.length} points` };
    return { rank: 0, value, text: millimetres(value), title: "largest error on the axis" };
  }

  /** Return the mean over the laps on unknown arms that were complete. */
  function completed(row, lap) {
    const found = row.columns.unknown && row.columns.unknown[0] && row.columns.unknown[0][lap];
    if (!found || found.rms === null) return { rank: 2, text: "–", title: found ? "all lost" : "not applicable" };
    return { rank: 0, value: found.rms, text: millimetres(found.rms), title: `mean of ${found.episodes - found.lost} of ${found.episodes} laps` };
  }

  function gap(row, lap) {
    const value = row.gaps[lap];
    return value === null ? { rank: 1, text: "lost", title: "no error" } : { rank: 0, value, text: value.toFixed(3), title: "0: best plan, 1: ifdc" };
  }

  // A half goes to the even digit, as in the pages' tables, which Python writes.
  function percent(lost, all) {
    const tenths = (1000 * lost) / all;
    const even = 2 * Math.round(tenths / 2);
    return ((Math.abs(tenths - even) === 0.5 ? even : Math.round(tenths)) / 10).toFixed(1);
  }

  function lostShare(row) {
    const laps = row.columns.unknown && row.columns.unknown[0];
    if (!laps) return { rank: 2, text: "–", title: "not applicable" };
    const [lost, all] = ["lost", "episodes"].map((name) => laps.reduce((sum, lap) => sum + lap[name], 0));
    return { rank: 0, value: lost / all, text: `${percent(lost, all)} %`, title: `${lost} of ${all}` };
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
    const byRank = (a, b) => a.privileged - b.privileged;
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
    const name = element("th", { scope: "row", class: "fx-name" }, breakable(`${row.name}${row.privileged ? " *" : ""}`));
    const reads = element("div", { class: "fx-reads" }, row.reads.join(", ") || "reads nothing");
    name.append(reads);
    if (row.replay) {
      name.append(element("a", { class: "fx-play", href: `${board.replays}#${encodeURIComponent(row.name)}` }, "▶ replay"));
    }
    const cells = shown.map((column) => {
      const one = column.at(row);
      const tinted = one.rank === 0 && !column.plain ? heat(one.value) : null;
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
    const figure = state.view === OVERVIEW ? "" : `, ${FIGURES[state.figure]}`;
    const column = board.columns[state.view];
    const nominal = column && column.values.includes(column.nominal) ? " The column with a bar on top is nominal." : "";
    const distance = `Distance of the true tip from the reference in mm${state.figure === "maximum" && figure ? "" : " (r.m.s.)"}${figure}`;
    return `${distance}; means count a lost lap as ${1000 * board.limit} mm, except those of completed laps; "lost": every lap. *: privileged, reads the true state.${nominal}`;
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
  const [TALL, LEFT, RIGHT, TOP, BOTTOM, LINE] = [320, 46, 140, 12, 36, 13]; // [px]

  /** Return the chart of the view's axis: the first rows of the table in colours and with their names, the others in grey. */
  function chart(found) {
    const column = board.columns[state.view];
    if (!column || typeof column.values[0] !== "number") return [];
    const width = Math.max(320, parts.chart.clientWidth);
    const [least, most] = [Math.min(...column.values), Math.max(...column.values)];
    const [low, high] = [ERRORS[0], ERRORS[ERRORS.length - 1]];
    const right = width - RIGHT;
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
    const names = `Labelled: the first ${Math.min(LABELLED, found.length)} rows of the table; point at another one to see it. ×: beyond this point the path is lost. Whole axis: at how many points the path is lost, else the largest error.`;
    return [picture, element("p", { class: "fx-hint" }, names)];
  }

  /** Return the line of a row, and where it ends. */
  function curve(row, column, x, y, style) {
    const group = drawn("g", { "data-row": row.name, class: `fx-curve${style}` }, drawn("title", {}, row.name));
    const cells = column.values.map((_, n) => cell(row, state.view, n));
    const lost = (n) => cells[n] && cells[n].rank === 1;
    let [path, last] = ["", null];
    cells.forEach((one, n) => {
      if (one.rank) return;
      const at = [x(column.values[n]).toFixed(1), y(one.value).toFixed(1)];
      path += `${n && !cells[n - 1].rank ? "L" : "M"}${at.join(" ")}`;
      if (lost(n - 1) || lost(n + 1)) group.append(drawn("text", { class: "fx-cross", x: at[0], y: Number(at[1]) + 4, "text-anchor": "middle" }, "×"));
      else group.append(drawn("circle", { cx: at[0], cy: at[1], r: 2.2 }));
      last = at.map(Number);
    });
    if (path) group.prepend(drawn("path", { d: path }));
    const mark = (name) => () => { state.marked = name; marks(); };
    group.addEventListener("mouseenter", mark(row.name));
    group.addEventListener("mouseleave", mark(null));
    return { name: row.name, group, last };
  }

  /** Write the names of lines into the margin, each beside its line's end, or as near as the others leave room. */
  function label(curves, right) {
    const named = curves.filter((one) => one.last).sort((a, b) => a.last[1] - b.last[1]);
    let free = TOP;
    const heights = named.map((one) => { free = Math.max(free, one.last[1]) + LINE; return free - LINE; });
    let most = TALL - BOTTOM;
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
    parts.figure = list("Figure", Object.entries(FIGURES), state.figure, change("figure"));
    parts.count = element("span", { class: "fx-hint", role: "status" });
    parts.chart = element("div");
    parts.table = element("table", { class: "fx-board" });
    const turn = (value) => { state.view = value; state.sort = value === OVERVIEW ? 2 : 1; state.down = false; draw(); };
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
