"use strict";
// The page of a batch. Strings from documents are inserted as text (textContent), never as HTML.
(() => {
  const batch = JSON.parse(document.getElementById("batch").textContent);
  const { columns, rows } = batch;
  const PAGE = { pictures: 60, table: 200 };
  const TOLD = 5; // settings on a card, and of a variant in a line
  const SPOKEN = { built: "built", kept_out: "excluded", refused: "refused", failed: "failed" };
  const PALETTE = ["#2b6a99", "#d98a2b", "#2f8f7a", "#b5495b", "#7a5ba6", "#8a6d3b", "#4aa5c4", "#66727f"];
  const SCALE = [[48, 62, 140], [42, 114, 142], [33, 157, 132], [110, 196, 88], [226, 205, 45]];
  const at = Object.fromEntries(columns.map((column, index) => [column.name, index]));
  const $ = (id) => document.getElementById(id);

  function make(tag, more = {}, ...children) {
    const node = document.createElement(tag);
    for (const [key, value] of Object.entries(more)) {
      if (key === "class") node.className = value;
      else if (key === "own") node.style.setProperty("--own", `var(--${value})`);
      else if (key in node) node[key] = value;
      else node.setAttribute(key, value);
    }
    node.append(...children);
    return node;
  }
  const cell = (row, name) => row[at[name]];
  const status = (row) => cell(row, "status");
  const isNumber = (column) => column.kind === "number" || column.kind === "integer";
  const number = (value) => (typeof value === "number" ? value : value === "inf" ? Infinity : null);
  function shown(value) {
    if (value === null || value === undefined) return "";
    if (typeof value !== "number") return String(value);
    if (Number.isInteger(value) || value === 0) return String(value);
    return String(Number(value.toPrecision(4)));
  }
  function inUnit(row, column) {
    const value = row[at[column.name]];
    return value === null ? "–" : shown(value) + (column.unit ? ` ${column.unit}` : "");
  }
  const label = (column) => column.name.replace(/^parameters\./, "").replace(/(^|\.)components\./g, "$1");
  const withUnit = (column) => label(column) + (column.unit ? ` [${column.unit}]` : "");

  // Show only columns in which the variants differ.
  const varies = columns.map((column, index) => rows.some((row) => row[index] !== rows[0][index]));
  const HEAD = ["index", "id", "name", "status", "rule", "code", "message", "path", "command"];
  const SECTIONS = /^(parameters|components|joints|defaults|links|materials|modes|poses|raw|sensors|simulation|tests)\./;
  const isSetting = (column) => SECTIONS.test(column.name) && !HEAD.includes(column.name);
  // Omit columns that are equal to a previous column, such as a parameter that is set to another one.
  const settings = columns.filter((column, index) => varies[index] && isSetting(column) && !columns.some((other, before) =>
    before < index && varies[before] && isSetting(other) && rows.every((row) => row[before] === row[index])));
  const results = columns.filter((column, index) => varies[index] && !isSetting(column) && !HEAD.includes(column.name));

  const state = {
    filter: "", statuses: new Set(Object.keys(SPOKEN)), sort: "index", down: false, view: "pictures", page: 0, every: false, chosen: null,
    x: null, y: null, colour: "status",
  };

  // --- which variants, in which order -------------------------------------------------------------------------------

  function columnOf(word) {
    const exact = columns.find((column) => column.name === word) || columns.find((column) => column.name === `parameters.${word}`);
    if (exact) return exact;
    const ends = columns.filter((column) => column.name.endsWith(`.${word}`));
    return ends.length === 1 ? ends[0] : null;
  }
  /** A test of rows for `mass<2.5 length>=0.3 status=built word`; throws an error message. */
  function tested(text) {
    const tests = text.trim().split(/\s+/).filter(Boolean).map((term) => {
      const found = /^([^<>=!]+)(<=|>=|!=|=|<|>)(.*)$/.exec(term);
      if (!found) {
        const word = term.toLowerCase();
        const texts = columns.map((column, index) => [column, index]).filter(([column]) => column.kind === "text" && column.name !== "command");
        return (row) => texts.some(([, index]) => row[index] !== null && String(row[index]).toLowerCase().includes(word));
      }
      const [, name, sign, wanted] = found;
      const column = columnOf(name);
      if (!column) throw `there is no column ${name}`;
      const index = at[column.name];
      if (wanted === "") return () => true; // still being typed
      if (!isNumber(column)) {
        if (sign !== "=" && sign !== "!=") throw `${name} is not a number`;
        return (row) => [String(row[index] ?? ""), SPOKEN[row[index]]].includes(wanted) === (sign === "=");
      }
      const bound = Number(wanted);
      if (Number.isNaN(bound)) throw `${wanted} is not a number`;
      const compare = { "<": (v) => v < bound, ">": (v) => v > bound, "<=": (v) => v <= bound, ">=": (v) => v >= bound,
        "=": (v) => v === bound, "!=": (v) => v !== bound }[sign];
      return (row) => { const value = number(row[index]); return value !== null && compare(value); };
    });
    return (row) => tests.every((test) => test(row));
  }
  function compared(column) {
    const index = at[column.name];
    const way = state.down ? -1 : 1;
    return (a, b) => {
      const u = a[index], v = b[index];
      if (u === v) return a[0] - b[0];
      if (u === null) return 1; // rows without a value are last in both directions
      if (v === null) return -1;
      if (isNumber(column)) return way * (number(u) - number(v));
      return way * (String(u) < String(v) ? -1 : 1);
    };
  }
  let wanted = rows;
  function choose() {
    const input = $("filter");
    let test;
    try {
      test = tested(state.filter);
      input.classList.remove("wrong");
      $("said").textContent = "";
    } catch (words) {
      input.classList.add("wrong");
      $("said").textContent = words;
      return;
    }
    wanted = rows.filter((row) => state.statuses.has(status(row)) && test(row)).sort(compared(columns[at[state.sort]]));
    const of = batch.count > rows.length ? `${rows.length} of ${batch.count}` : `${rows.length}`;
    $("said").textContent = wanted.length === rows.length && batch.count === rows.length ? `${of} variants` : `${wanted.length} of ${of} variants`;
  }

  // --- the list -------------------------------------------------------------------------------------------------------

  const why = (row) => cell(row, "rule") ?? [cell(row, "code"), cell(row, "message")].filter(Boolean).join(" ");
  const picture = (row) => (row[row.length - 1] ? `pictures/${cell(row, "id")}.png` : null);

  function card(row) {
    const pairs = make("dl", { class: "pairs" });
    const told = settings.slice(0, TOLD).map((column) => [column, false]);
    if (!["index", "name", "id", "status"].includes(state.sort)) {
      const column = columns[at[state.sort]];
      const known = told.find(([one]) => one === column);
      if (known) known[1] = true;
      else told.push([column, true]);
    }
    for (const [column, sorted] of told) {
      pairs.append(
        make("dt", { class: sorted ? "sorted" : "", title: column.name }, label(column)),
        make("dd", { class: sorted ? "sorted" : "" }, inUnit(row, column)),
      );
    }
    if (settings.length > TOLD) pairs.append(make("dt", {}, `and ${settings.length - TOLD} more`), make("dd", {}, ""));
    const image = make("img", { src: picture(row), loading: "lazy", alt: cell(row, "name"), width: 240, height: 180 });
    return make("button", { class: `card${row === state.chosen ? " chosen" : ""}`, type: "button", "data-id": cell(row, "id"), onclick: () => select(row) },
      image, make("div", { class: "text" },
        make("div", { class: "name" }, make("span", { class: "dot", own: status(row), title: SPOKEN[status(row)] }), make("span", {}, cell(row, "name"))), pairs));
  }
  /** A line for a variant without a picture: its settings, or why it was not built. */
  function line(row) {
    const words = status(row) === "built"
      ? settings.slice(0, TOLD).map((column) => `${label(column)} ${inUnit(row, column)}`).join(" · ") : `${SPOKEN[status(row)]}: ${why(row)}`;
    return make("button", { class: `line${row === state.chosen ? " chosen" : ""}`, type: "button", "data-id": cell(row, "id"), onclick: () => select(row) },
      make("span", { class: "dot", own: status(row), title: SPOKEN[status(row)] }), make("span", { class: "name" }, cell(row, "name")),
      make("span", { class: "why", title: words }, words));
  }
  function bare(found) {
    const counts = Object.entries(SPOKEN).map(([one, spoken]) => [found.filter((row) => status(row) === one).length, spoken]).filter(([count]) => count);
    $("bare").hidden = !found.length;
    $("bare").querySelector("summary").textContent = `${found.length} without a picture: ${counts.map((pair) => pair.join(" ")).join(", ")}`;
    const lines = found.slice(0, PAGE.table).map(line);
    if (found.length > lines.length) lines.push(make("span", { class: "why" }, `and ${found.length - lines.length} more, in the table`));
    $("bare").querySelector(".lines").replaceChildren(...lines);
  }
  function visibleColumns() {
    if (state.every) return columns.filter((column) => column.name !== "command");
    const head = columns.filter((column) => ["name", "status", "rule", "code", "message"].includes(column.name) && varies[at[column.name]]);
    if (!head.some((column) => column.name === "name")) head.unshift(columns[at.name]);
    return [...head, ...settings, ...results];
  }
  function table(part) {
    const body = document.querySelector("#rows tbody"), head = document.querySelector("#rows thead");
    const seen = visibleColumns();
    head.replaceChildren(make("tr", {}, ...seen.map((column) => make("th", {
      class: [isNumber(column) ? "number" : "", column.name === state.sort ? "sorted" : ""].join(" ").trim(), title: column.name,
      "data-column": column.name, onclick: () => sortBy(column.name),
    }, label(column), ...(column.unit ? [make("small", {}, column.unit)] : []), column.name === state.sort ? (state.down ? " ↓" : " ↑") : ""))));
    body.replaceChildren(...part.map((row) => make("tr", { class: row === state.chosen ? "chosen" : "", "data-id": cell(row, "id"), onclick: () => select(row) },
      ...seen.map((column) => {
        const value = column.name === "status" ? SPOKEN[status(row)] : shown(row[at[column.name]]);
        return make("td", { class: isNumber(column) ? "number" : "", title: value }, value);
      }))));
  }
  function list() {
    const size = PAGE[state.view];
    const found = state.view === "pictures" ? wanted.filter(picture) : wanted;
    const last = Math.max(0, Math.ceil(found.length / size) - 1);
    state.page = Math.min(state.page, last);
    const part = found.slice(state.page * size, (state.page + 1) * size);
    bare(state.view === "pictures" ? wanted.filter((row) => !picture(row)) : []);
    $("grid").hidden = state.view !== "pictures";
    $("grid").style.display = state.view === "pictures" ? "" : "none";
    $("rows").hidden = $("every-label").hidden = state.view !== "table";
    $("every-label").style.display = state.view === "table" ? "" : "none";
    if (state.view === "pictures") $("grid").replaceChildren(...part.map(card));
    else table(part);
    $("pages").replaceChildren();
    if (last > 0) {
      const turn = (by) => () => { state.page += by; list(); $("list").scrollIntoView(); };
      $("pages").append(
        make("button", { type: "button", disabled: state.page === 0, onclick: turn(-1) }, "‹ back"),
        make("span", {}, `${state.page * size + 1} to ${state.page * size + part.length} of ${found.length}`),
        make("button", { type: "button", id: "next", disabled: state.page === last, onclick: turn(1) }, "more ›"),
      );
    }
    $("view-pictures").setAttribute("aria-pressed", state.view === "pictures");
    $("view-table").setAttribute("aria-pressed", state.view === "table");
    $("direction").textContent = state.down ? "↓ descending" : "↑ ascending";
    $("sort").value = state.sort;
  }
  function sortBy(name) {
    if (state.sort === name) state.down = !state.down;
    else { state.sort = name; state.down = false; }
    state.page = 0;
    choose();
    list();
  }
  function select(row) {
    state.chosen = row;
    for (const node of document.querySelectorAll("[data-id]")) node.classList.toggle("chosen", node.dataset.id === cell(row, "id"));
    const pairs = (found) => make("dl", { class: "pairs" }, ...found.flatMap((column) => [
      make("dt", { title: column.name }, label(column)),
      make("dd", {}, shown(row[at[column.name]]) + (column.unit && row[at[column.name]] !== null ? ` ${column.unit}` : "")),
    ]));
    const source = picture(row), path = cell(row, "path");
    $("one").replaceChildren(
      make("h2", {}, cell(row, "name")),
      make("p", { class: "state" }, `${SPOKEN[status(row)]}${why(row) ? `: ${why(row)}` : ""} · `,
        path && batch.layout === "folders" ? make("a", { href: `${path}/` }, cell(row, "id")) : cell(row, "id")),
      ...(source ? [make("img", { src: source, alt: "" })] : []),
      pairs(settings), pairs(columns.filter((column) => isNumber(column) && !isSetting(column) && column.name !== "index" && row[at[column.name]] !== null)),
      make("code", { title: "build only this variant" }, cell(row, "command") ?? ""),
    );
    $("one").hidden = false;
    history.replaceState(null, "", `#${cell(row, "id")}`); // the address selects the variant
  }

  // --- the plot -------------------------------------------------------------------------------------------------------

  const svg = (tag, more = {}, ...children) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(more)) node.setAttribute(key, value);
    node.append(...children);
    return node;
  };
  /** The ticks of an axis: round numbers, or every value of strings and flags. */
  function axis(column, found) {
    const index = at[column.name];
    if (!isNumber(column)) {
      const known = [...new Set(found.map((row) => String(row[index])))].sort();
      return { value: (row) => known.indexOf(String(row[index])), low: -0.5, high: known.length - 0.5,
        ticks: known.slice(0, 12).map((text, k) => [k, text.length > 14 ? `${text.slice(0, 13)}…` : text]) };
    }
    const values = found.map((row) => number(row[index]));
    let low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!(high > low)) { const half = Math.abs(low) * 0.05 || 0.5; low -= half; high += half; }
    const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5, 10].find((by) => by * power >= rough) ?? 10);
    const room = (high - low) * 0.04;
    low -= room; high += room;
    const ticks = [];
    for (let k = Math.ceil(low / step); k * step <= high; k += 1) ticks.push([k * step, shown(Number((k * step).toPrecision(10)))]);
    return { value: (row) => number(row[index]), low, high, ticks };
  }
  function shade(part) {
    const place = Math.max(0, Math.min(1, part)) * (SCALE.length - 1), k = Math.min(SCALE.length - 2, Math.floor(place));
    return `rgb(${SCALE[k].map((one, c) => Math.round(one + (SCALE[k + 1][c] - one) * (place - k))).join(" ")})`;
  }
  function colouring(column, found) {
    if (column.name === "status") {
      const there = Object.keys(SPOKEN).filter((one) => found.some((row) => status(row) === one));
      return { of: (row) => `var(--${status(row)})`, legend: there.map((one) => [`var(--${one})`, SPOKEN[one]]) };
    }
    const index = at[column.name];
    if (isNumber(column)) {
      const values = found.map((row) => number(row[index])).filter((value) => value !== null && Number.isFinite(value));
      const low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), -Infinity);
      return { low, high, of: (row) => {
        const value = number(row[index]);
        return value === null ? "#c9d0d6" : shade(high > low ? (value - low) / (high - low) : 0.5);
      } };
    }
    const known = [...new Set(found.map((row) => String(row[index])))].sort();
    const colour = (text) => PALETTE[known.indexOf(text) % PALETTE.length];
    return { of: (row) => colour(String(row[index])), legend: known.slice(0, 12).map((text) => [colour(text), text]) };
  }
  function plot() {
    if (!state.x || !state.y) { $("plot").hidden = true; return; }
    const X = columns[at[state.x]], Y = columns[at[state.y]], C = columns[at[state.colour]];
    const has = (row, column) => { const value = row[at[column.name]]; return isNumber(column) ? Number.isFinite(number(value) ?? NaN) : value !== null; };
    const found = wanted.filter((row) => has(row, X) && has(row, Y));
    const width = 460, height = 330, left = 58, right = 10, top = 22, bottom = 40;
    const drawn = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${state.y} against ${state.x}` });
    $("legend").replaceChildren();
    if (found.length) {
      const x = axis(X, found), y = axis(Y, found), c = colouring(C, found);
      const u = (value) => left + (value - x.low) / (x.high - x.low) * (width - left - right);
      const v = (value) => height - bottom - (value - y.low) / (y.high - y.low) * (height - top - bottom);
      for (const [value, text] of y.ticks) {
        drawn.append(svg("line", { x1: left, x2: width - right, y1: v(value), y2: v(value) }), svg("text", { x: left - 7, y: v(value) + 4, "text-anchor": "end" }, text));
      }
      for (const [value, text] of x.ticks) {
        drawn.append(svg("line", { x1: u(value), x2: u(value), y1: top, y2: height - bottom }), svg("text", { x: u(value), y: height - bottom + 16, "text-anchor": "middle" }, text));
      }
      drawn.append(svg("text", { class: "title", x: width - right, y: height - 6, "text-anchor": "end" }, withUnit(X)), svg("text", { class: "title", x: 2, y: 12 }, withUnit(Y)));
      const radius = found.length > 2000 ? 2 : found.length > 300 ? 3 : 4.5;
      for (const row of found) {
        const point = svg("circle", { cx: u(x.value(row)).toFixed(1), cy: v(y.value(row)).toFixed(1), r: radius, "data-id": cell(row, "id"),
          style: status(row) === "built" ? `fill: ${c.of(row)}` : `fill: #fff; stroke: ${c.of(row)}; stroke-width: 1.6` },
          svg("title", {}, `${cell(row, "name")}\n${label(X)} ${shown(cell(row, X.name))}\n${label(Y)} ${shown(cell(row, Y.name))}`));
        if (row === state.chosen) point.classList.add("chosen");
        point.addEventListener("click", () => select(row));
        drawn.append(point);
      }
      if (c.legend) $("legend").append(...c.legend.map(([colour, text]) => make("span", { class: "key" }, make("i", { class: "dot", style: `background: ${colour}` }), text)));
      else if (c.high >= c.low) {
        const bar = make("i", { class: "bar", style: `background: linear-gradient(90deg, ${[0, 0.25, 0.5, 0.75, 1].map(shade).join(", ")})` });
        $("legend").append(make("span", {}, `${label(C)} ${shown(c.low)}`, bar, `${shown(c.high)}${C.unit ? ` ${C.unit}` : ""}`));
      }
    }
    if (found.some((row) => status(row) !== "built") && state.colour !== "status") $("legend").append(make("span", {}, "○ not built"));
    if (found.length < wanted.length) $("legend").append(make("span", {}, `${wanted.length - found.length} without a value`));
    $("chart").replaceChildren(drawn);
  }

  // --- the controls -----------------------------------------------------------------------------------------------------

  function options(select, groups, value) {
    for (const [title, found] of groups) {
      if (!found.length) continue;
      select.append(make("optgroup", { label: title }, ...found.map((column) => make("option", { value: column.name }, withUnit(column)))));
    }
    select.value = value;
  }
  function refresh() { choose(); list(); plot(); }

  $("title").textContent = batch.name;
  $("subtitle").textContent = [batch.document, `variants of ${batch.assembly}`, batch.pose ? `results in ${batch.modes[0]}, pose ${batch.pose}` : `results in ${batch.modes[0]}`,
    ...(batch.finished ? [] : [`not finished: ${batch.done} of ${batch.count} done`]),
    ...(rows.length < batch.done ? [`${rows.length} of ${batch.done} variants, evenly spread; the tables have all`] : [])].join(" · ");
  for (const [one, spoken] of Object.entries(SPOKEN)) {
    const count = rows.filter((row) => status(row) === one).length;
    if (!count) continue;
    const chip = make("button", { class: "chip", type: "button", own: one, "data-status": one, "aria-pressed": "true" }, `${count} ${spoken}`);
    chip.addEventListener("click", () => {
      if (state.statuses.has(one)) state.statuses.delete(one);
      else state.statuses.add(one);
      chip.setAttribute("aria-pressed", state.statuses.has(one));
      state.page = 0;
      refresh();
    });
    $("statuses").append(chip);
  }
  const plain = ["index", "name", "status", "code"].map((name) => columns[at[name]]);
  options($("sort"), [["variants", plain], ["settings", settings], ["results", results]], state.sort);
  const numbers = (found) => found.filter(isNumber);
  state.x = (numbers(settings)[0] ?? settings[0] ?? columns[at.index]).name;
  state.y = (["reach", "mass", "torque_margin"].map((name) => results.find((column) => column.name === name)).find(Boolean) ?? results[0] ?? columns[at.index]).name;
  if (numbers(settings).length > 1) state.colour = numbers(settings)[1].name;
  const axes = [["settings", settings], ["results", results], ["variants", [columns[at.index], columns[at.status]]]];
  for (const [id, key] of [["plot-x", "x"], ["plot-y", "y"], ["plot-colour", "colour"]]) {
    options($(id), axes, state[key]);
    $(id).addEventListener("change", () => { state[key] = $(id).value; plot(); });
  }
  if (numbers(settings).length) $("filter").placeholder = `${label(numbers(settings)[0])}>${shown(number(rows[0][at[numbers(settings)[0].name]]))} status=built`;
  $("filter").addEventListener("input", () => { state.filter = $("filter").value; state.page = 0; refresh(); });
  $("sort").addEventListener("change", () => { state.sort = $("sort").value; state.page = 0; choose(); list(); });
  $("direction").addEventListener("click", () => { state.down = !state.down; state.page = 0; choose(); list(); });
  $("view-pictures").addEventListener("click", () => { state.view = "pictures"; state.page = 0; list(); });
  $("view-table").addEventListener("click", () => { state.view = "table"; state.page = 0; list(); });
  $("every").addEventListener("change", () => { state.every = $("every").checked; list(); });
  if (!rows.some(picture)) {
    state.view = "table";
    $("view-pictures").disabled = true;
    $("view-pictures").title = "no pictures; to draw them, run thingc batch --page-only --pictures N";
  }
  refresh();
  const named = rows.find((row) => `#${cell(row, "id")}` === location.hash);
  if (named) { select(named); plot(); }
})();
