
"use strict";
// The table of cases. What it shows stands in the address, after #, so that a link shows the same:
// #sort=force&order=down&status=ok&epsilon=10 mm&text=…&columns=all&rows=400
(() => {
  const table = document.getElementById("table");
  const form = document.querySelector(".filters");
  const further = document.getElementById("further");
  const all = document.getElementById("all");
  const { columns, order, rows: step } = JSON.parse(document.getElementById("data").textContent);
  const byName = new Map(columns.map((column) => [column.name, column]));
  const heads = new Map([...table.tHead.rows[0].cells].map((head) => [head.dataset.name, head]));
  const nothing = () => ({ sort: "", order: "up", filters: {}, text: "", full: false, rows: step });
  const most = 3000; // rows that a phone can still lay out
  let state = nothing();

  const textOf = (column, row) => {
    const value = column.values[row];
    return column.words ? column.words[value] : value === null ? "" : String(value);
  };

  function read() {
    const given = new URLSearchParams(location.hash.slice(1));
    const found = nothing();
    found.sort = byName.has(given.get("sort")) ? given.get("sort") : "";
    found.order = given.get("order") === "down" ? "down" : "up";
    found.text = given.get("text") || "";
    found.full = given.get("columns") === "all";
    found.rows = Math.min(most, Math.max(step, Number.parseInt(given.get("rows"), 10) || 0));
    for (const column of columns) {
      const word = given.get(column.name);
      if (column.is_filter && column.words.includes(word)) found.filters[column.name] = word;
    }
    return found;
  }

  function write() {
    const told = new URLSearchParams(state.filters);
    if (state.sort) told.set("sort", state.sort);
    if (state.sort && state.order === "down") told.set("order", "down");
    if (state.text) told.set("text", state.text);
    if (state.full) told.set("columns", "all");
    if (state.rows > step) told.set("rows", state.rows);
    history.replaceState(null, "", `#${told.size || [...told].length ? told : "cases"}`);
  }

  function chosen() {
    const filters = Object.entries(state.filters).map(([name, word]) => {
      const column = byName.get(name);
      return [column.values, column.words.indexOf(word)];
    });
    const words = state.text.toLowerCase().split(/\s+/).filter(Boolean);
    const found = order.filter(
      (row) =>
        filters.every(([values, code]) => values[row] === code) &&
        (!words.length || matches(words, columns.map((column) => textOf(column, row)).join("\n").toLowerCase())),
    );
    return state.sort ? sorted(found, byName.get(state.sort)) : found;
  }

  const matches = (words, text) => words.every((word) => text.includes(word));

  // Cases without a value come last, whichever way the others are sorted.
  function sorted(found, column) {
    const sign = state.order === "down" ? -1 : 1;
    const key = (row) => {
      const value = column.values[row];
      if (!column.words || value === null) return value;
      return column.keys ? column.keys[value] : column.words[value] || null;
    };
    const compare = (a, b) => (a === b ? 0 : typeof a === "string" ? a.localeCompare(b, "en") : a - b);
    const known = found.filter((row) => key(row) !== null);
    const unknown = found.filter((row) => key(row) === null);
    return [...known.sort((a, b) => sign * compare(key(a), key(b))), ...unknown];
  }

  function draw() {
    const found = chosen();
    const shown = found.slice(0, state.rows);
    const status = byName.get("status");
    const body = document.createElement("tbody");
    for (const row of shown) {
      const line = body.insertRow();
      line.className = status.words[status.values[row]];
      for (const column of columns) {
        const cell = line.insertCell();
        cell.className = `${column.words ? "word" : "number"}${column.is_first ? "" : " more"} ${column.name}`;
        cell.textContent = textOf(column, row);
      }
    }
    table.tBodies[0].replaceWith(body);
    table.classList.toggle("full", state.full);
    for (const [name, head] of heads) {
      const way = state.order === "down" ? "descending" : "ascending";
      head.setAttribute("aria-sort", name === state.sort ? way : "none");
    }
    const how = state.sort ? `sorted by ${byName.get(state.sort).heading}` : "failed ones first";
    const many = found.length === order.length ? `${order.length} cases` : `${found.length} matching of ${order.length} cases`;
    const message = shown.length < found.length ? `Shown: the first ${shown.length} of ${many}` : `Shown: ${many}`;
    document.getElementById("shown").textContent = `${message}, ${how}.`;
    const limit = Math.min(most, found.length);
    further.parentElement.hidden = shown.length === limit;
    further.textContent = `show ${Math.min(step, limit - shown.length)} more`;
    all.textContent = limit < found.length ? `show the first ${limit}` : `show all ${limit}`;
    all.onclick = () => change({ rows: limit });
  }

  // The form says what is chosen, whoever chose it.
  function fill() {
    for (const field of form.elements) {
      if (field.name === "text") field.value = state.text;
      else if (field.name === "columns") field.checked = state.full;
      else if (field.name) field.value = state.filters[field.name] || "";
    }
  }

  function change(what) {
    state = { ...state, ...what };
    write();
    draw();
  }

  function sortBy(name) {
    if (state.sort !== name) change({ sort: name, order: "up" });
    else if (state.order === "up") change({ order: "down" });
    else change({ sort: "", order: "up" });
  }

  for (const [name, head] of heads) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    button.addEventListener("click", () => sortBy(name));
    head.replaceChildren(button);
  }
  form.addEventListener("input", (event) => {
    const { name, value, checked } = event.target;
    if (name === "text") change({ text: value, rows: step });
    else if (name === "columns") change({ full: checked });
    else {
      const filters = { ...state.filters };
      if (value) filters[name] = value;
      else delete filters[name];
      change({ filters, rows: step });
    }
  });
  form.addEventListener("reset", (event) => {
    event.preventDefault();
    change({ ...nothing(), full: state.full });
    fill();
  });
  form.addEventListener("submit", (event) => event.preventDefault());
  further.addEventListener("click", () => change({ rows: Math.min(most, state.rows + step) }));

  function follow() {
    if (!location.hash.includes("=")) return;
    state = read();
    fill();
    draw();
    document.getElementById("cases").scrollIntoView();
  }
  window.addEventListener("hashchange", follow);
  form.hidden = false;
  fill();
  draw();
  follow();
})();
