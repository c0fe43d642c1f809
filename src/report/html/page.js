// What a page does beyond showing itself: tables that are sorted by a click, quick hints over plots, and links from plots and
// tables to images. A link is an event `show-image` with the image's name; viewers listen to it.
document.documentElement.classList.add("scripts");

const show = (name) => document.dispatchEvent(new CustomEvent("show-image", { detail: name }));

// Numbers come before texts. Cells without a number sort by their text.
function compare(a, b) {
  const [x, y] = [a.dataset.order, b.dataset.order];
  if (x !== undefined && y !== undefined) return Number(x) - Number(y);
  if (x !== undefined || y !== undefined) return x !== undefined ? -1 : 1;
  return a.textContent.localeCompare(b.textContent, "en", { numeric: true });
}

function sortBy(table, column, header) {
  const descending = header.getAttribute("aria-sort") === "ascending";
  const body = table.tBodies[0];
  const rows = [...body.rows];
  // What has no number stays last in both directions.
  const hasNumber = (row) => row.cells[column].dataset.order !== undefined;
  const numbers = rows.some(hasNumber) ? rows.filter(hasNumber) : rows;
  const others = rows.filter((row) => !numbers.includes(row));
  numbers.sort((a, b) => compare(a.cells[column], b.cells[column]));
  if (descending) numbers.reverse();
  body.append(...numbers, ...others);
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  header.setAttribute("aria-sort", descending ? "descending" : "ascending");
}

for (const table of document.querySelectorAll("table.sortable")) {
  [...table.tHead.rows[0].cells].forEach((header, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = header.textContent;
    button.addEventListener("click", () => sortBy(table, column, header));
    header.replaceChildren(button);
  });
}

const names = new Set([...document.querySelectorAll("figure[data-name]")].map((figure) => figure.dataset.name));
for (const row of document.querySelectorAll("tr[data-show]")) {
  if (!names.has(row.dataset.show)) {
    delete row.dataset.show;
    continue;
  }
  row.tabIndex = 0;
  row.addEventListener("click", () => show(row.dataset.show));
  row.addEventListener("keydown", (event) => event.key === "Enter" && show(row.dataset.show));
}

const tip = document.createElement("div");
tip.className = "tip";
tip.hidden = true;
document.body.append(tip);

function placeTip(event) {
  const { clientWidth: width, clientHeight: height } = document.documentElement;
  const x = Math.min(event.clientX + 14, width - tip.offsetWidth - 4);
  const below = event.clientY + 16;
  const y = below + tip.offsetHeight > height ? event.clientY - tip.offsetHeight - 8 : below;
  tip.style.left = `${Math.max(4, x) + scrollX}px`;
  tip.style.top = `${y + scrollY}px`;
}

// Without scripts the title elements are the hints, which browsers show late.
for (const mark of document.querySelectorAll(".plot .tt")) {
  const title = mark.querySelector("title");
  if (!title) continue;
  const text = title.textContent;
  title.remove();
  mark.setAttribute("aria-label", text);
  mark.addEventListener("pointerenter", (event) => {
    tip.textContent = text;
    tip.hidden = false;
    placeTip(event);
  });
  mark.addEventListener("pointermove", placeTip);
  mark.addEventListener("pointerleave", () => { tip.hidden = true; });
  const name = text.split("\n")[0];
  if (names.has(name)) mark.addEventListener("click", () => show(name));
}
