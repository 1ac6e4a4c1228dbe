// The table of cases, by DataTables. What the table shows is in the address, after #, so that
// a link shows the same: #sort=force&order=down&status=ok&epsilon=10 mm&text=…&columns=all&rows=200
const { columns, order, rows: step } = JSON.parse(document.getElementById("data").textContent);
const byName = new Map(columns.map((column) => [column.name, column]));
const form = document.getElementById("filters");
const escaped = (text) => text.replace(/[&<>"'$]/g, (sign) => `&#${sign.charCodeAt(0)};`);
const marked = (text) => escaped(text).replace(/`([^`]+)`/g, "<code>$1</code>");

function textOf(column, row) {
  const value = column.values[row];
  if (column.words) return column.words[value];
  if (value === null) return "";
  return column.decimals ? value.toFixed(column.decimals[row]) : String(value);
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
      return kind === "display" ? marked(textOf(column, row)) : textOf(column, row);
    },
  })),
  createdRow: (line, { row }) => line.classList.add(...textOf(byName.get("status"), row).split(" ")),
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
  const chosen = new URLSearchParams();
  for (const { name, value, checked } of form.elements) {
    if (name === "columns" ? checked : name && value) chosen.set(name, name === "columns" ? "all" : value);
  }
  const [sorted] = table.order();
  if (sorted && sorted[1]) chosen.set("sort", columns[sorted[0]].name);
  if (sorted && sorted[1] === "desc") chosen.set("order", "down");
  if (table.page.len() !== step) chosen.set("rows", table.page.len());
  history.replaceState(null, "", `#${[...chosen].length ? chosen : "cases"}`);
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
