// The table of cases, by DataTables, and the curves, by plotly. What the table shows is in the address, after #, so that
// a link shows the same: #sort=force&order=down&status=ok&epsilon=10 mm&text=…&columns=all&rows=200
const { columns, order, rows: step } = JSON.parse(document.getElementById("data").textContent);
const byName = new Map(columns.map((column) => [column.name, column]));
const form = document.getElementById("filters");
const escaped = (text) => text.replace(/[&<>"'$]/g, (sign) => `&#${sign.charCodeAt(0)};`);

function textOf(column, row) {
  const value = column.values[row];
  return column.words ? column.words[value] : value === null ? "" : String(value);
}

function keyOf(column, row) {
  const value = column.values[row];
  if (!column.words || value === null) return value;
  return column.keys ? column.keys[value] : column.words[value] || null;
}

// Cases without a value come last, whichever way the others are sorted.
function by(sign) {
  return (a, b) => {
    if (a === b) return 0;
    if (a === null || b === null) return a === null ? 1 : -1;
    return sign * (typeof a === "string" ? a.localeCompare(b, "en") : a - b);
  };
}
Object.assign(DataTable.ext.type.order, { "case-asc": by(1), "case-desc": by(-1) });
document.querySelector("#table tbody").replaceChildren();
const table = new DataTable("#table", {
  data: order.map((row) => ({ row })),
  columns: columns.map((column) => ({
    name: column.name,
    type: "case",
    visible: column.is_first,
    className: `${column.words ? "word" : "number"} ${column.name}`,
    data: ({ row }, kind) => {
      if (kind === "sort" || kind === "type") return keyOf(column, row);
      return kind === "display" ? escaped(textOf(column, row)) : textOf(column, row);
    },
  })),
  createdRow: (line, { row }) => line.classList.add(textOf(byName.get("status"), row)),
  order: [],
  autoWidth: false,
  deferRender: true,
  pageLength: step,
  lengthMenu: [step, 5 * step, 20 * step],
  layout: { topStart: null, topEnd: null, bottomStart: "info", bottomEnd: ["pageLength", "paging"] },
  language: { info: "Cases _START_ to _END_ of _TOTAL_", infoEmpty: "No case", infoFiltered: "matching, of _MAX_" },
});

function apply() {
  for (const { name, value, checked } of form.elements) {
    if (name === "text") table.search(value);
    else if (name === "columns") columns.forEach((c, i) => table.column(i).visible(c.is_first || checked, false));
    else if (name) table.column(`${name}:name`).search(value ? (text) => text === value : "");
  }
  table.draw();
}

function write() {
  const told = new URLSearchParams();
  for (const { name, value, checked } of form.elements) {
    if (name === "columns" ? checked : name && value) told.set(name, name === "columns" ? "all" : value);
  }
  const [sorted] = table.order();
  if (sorted && sorted[1]) told.set("sort", columns[sorted[0]].name);
  if (sorted && sorted[1] === "desc") told.set("order", "down");
  if (table.page.len() !== step) told.set("rows", table.page.len());
  history.replaceState(null, "", `#${[...told].length ? told : "cases"}`);
}

function follow() {
  if (!location.hash.includes("=")) return;
  const given = new URLSearchParams(location.hash.slice(1));
  for (const field of form.elements) {
    if (field.name === "columns") field.checked = given.get("columns") === "all";
    else if (field.name) field.value = given.get(field.name) || "";
    if (field.selectedIndex === -1) field.value = "";
  }
  const sort = columns.findIndex((column) => column.name === given.get("sort"));
  table.order(sort < 0 ? [] : [[sort, given.get("order") === "down" ? "desc" : "asc"]]);
  const rows = Number.parseInt(given.get("rows"), 10);
  table.page.len(rows > 0 ? rows : step);
  apply();
  document.getElementById("cases").scrollIntoView();
}

form.addEventListener("input", apply);
form.addEventListener("reset", () => setTimeout(() => (table.order([]), apply())));
form.addEventListener("submit", (event) => event.preventDefault());
form.hidden = false;
follow();
table.on("draw", write);
window.addEventListener("hashchange", follow);

// The curves: one for each combination of what is swept, but for what is drawn across. Few have a colour and a name each;
// many share those of one swept quantity.
const MOST_NAMED = 7;
const axes = document.querySelector(".axes");
const swept = columns.filter((column) => column.is_axis && column.words.length > 1);
const measured = columns.filter((column) => !column.words && column.name !== "case");
const alone = (column) => ({ column, label: (row) => `${column.heading} = ${textOf(column, row)}` });
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const nameOf = (labels, row) => labels.map(({ label }) => label(row)).join(", ");
const isShown = (row) =>
  swept.every((column) => {
    const wanted = axes.elements[`only-${column.name}`].value;
    return !wanted || wanted === textOf(column, row);
  });

// The rows of each curve across `x`.
function groups(x) {
  const along = x.is_axis ? x : byName.get("epsilon") || swept[0];
  const others = swept.filter((column) => column !== along).map(alone);
  const found = new Map();
  for (const row of [...order].sort((a, b) => a - b).filter(isShown)) {
    const name = nameOf(others, row);
    if (!found.has(name)) found.set(name, []);
    found.get(name).push(row);
  }
  return [found, others.map(({ column }) => column)];
}

// What colours tell apart: what was chosen; else each curve, where there are few; else what has few values, outside first.
function coloured(count, others) {
  const chosen = axes.elements.colour.value;
  if (chosen) return others.find(({ name }) => name === chosen);
  if (count <= MOST_NAMED) return undefined;
  const few = others.filter(({ words }) => words.length <= MOST_NAMED);
  return few.find(({ name }) => name === "outside") || few.at(-1) || others[0];
}

function curves(x, y) {
  const [found, others] = groups(x);
  const by = coloured(found.size, others);
  const named = new Map();
  const bars = ["force", "force_exact_ratio"].includes(y.name) && byName.get("force_error_share");
  return [...found].map(([name, rows]) => {
    const entry = by ? alone(by).label(rows[0]) : name;
    const isFirst = !named.has(entry);
    if (isFirst) named.set(entry, named.size);
    const number = named.get(entry);
    return {
      name: wrapped(entry, 34),
      legendgroup: String(number),
      showlegend: isFirst,
      x: rows.map((row) => (x.words ? place(x, x.values[row]) : x.values[row])),
      y: rows.map((row) => y.values[row]),
      text: rows.map((row) => escaped(`case ${byName.get("case").values[row]}: ${nameOf(columns.filter((c) => c.is_axis).map(alone), row)}`)),
      error_y: bars ? { array: rows.map((row) => (y.values[row] * bars.values[row]) / 100), thickness: 1 } : undefined,
      line: { color: style(`--curve-${(number % 7) + 1}`), dash: number < 7 ? "solid" : "dash" },
      marker: { symbol: number % 7 },
      hovertemplate: "%{text}<br>%{y}<extra></extra>",
      mode: x.keys || !x.words ? "lines+markers" : "markers",
    };
  });
}

// Numbers are to scale, in the unit that is read, the full order a step past the largest; words are in a row.
function place(column, index) {
  if (!column.keys) return index;
  const finite = column.words.filter((_, i) => column.keys[i] < 1e300).map(Number.parseFloat);
  return column.keys[index] < 1e300 ? Number.parseFloat(column.words[index]) : 1.2 * Math.max(...finite, 0) || 1;
}

const tickOf = (column, word) => (column.keys ? word.split(" ")[0] : word);

function plot() {
  const [x, y] = ["x", "y"].map((name) => byName.get(axes.elements[name].value));
  const ticks = x.words && { tickvals: x.words.map((_, i) => place(x, i)), ticktext: x.words.map((word) => escaped(tickOf(x, word))) };
  const isNarrow = innerWidth < 700;
  const lines = { gridcolor: style("--grid"), zeroline: false, automargin: true };
  const type = axes.elements.log.checked ? "log" : "linear";
  Plotly.react(
    "plot",
    curves(x, y),
    {
      paper_bgcolor: "transparent",
      plot_bgcolor: "transparent",
      font: { color: style("--ink"), size: 14 },
      hovermode: "closest",
      showlegend: true,
      legend: isNarrow ? { orientation: "h", yref: "container", y: 1, yanchor: "top" } : {},
      margin: { t: isNarrow ? 20 : 40, r: 20 },
      modebar: { bgcolor: "transparent", color: style("--quiet"), activecolor: style("--ink") },
      xaxis: { ...lines, ...ticks, title: { text: wrapped(x.axis, isNarrow ? 36 : 80) } },
      yaxis: { ...lines, type, title: { text: wrapped(y.axis, 40) } },
    },
    {
      responsive: true,
      displaylogo: false,
      displayModeBar: !isNarrow,
      plotlyServerURL: "", // nothing of a page leaves it
      modeBarButtonsToRemove: ["sendChartToCloud", "select2d", "lasso2d"],
    },
  );
}

// Return text in lines of about so many letters.
function wrapped(text, letters) {
  const lines = [""];
  for (const word of text.split(" ")) {
    if (lines.at(-1) && lines.at(-1).length + word.length > letters) lines.push("");
    lines.push(`${lines.pop()} ${word}`.trim());
  }
  return lines.map(escaped).join("<br>");
}

if (swept.length && measured.length) {
  axes.elements.colour.append(new Option("automatic", ""), ...swept.map((column) => new Option(column.heading, column.name)));
  axes.addEventListener("input", plot);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", plot);
  axes.closest("section").hidden = false;
  plot();
}
