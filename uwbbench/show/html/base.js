"use strict";
// What the scripts of all pages share: the switch of the theme, and tables that sort.
const base = (() => {
  const root = document.documentElement, button = document.getElementById("theme");
  const themes = ["auto", "light", "dark"];
  const remembered = () => { try { return localStorage.getItem("uwbbench-theme"); } catch { return null; } };
  function setTheme(name) {
    if (name === "auto") root.removeAttribute("data-theme"); else root.dataset.theme = name;
    button.textContent = "Theme: " + name;
    button.dataset.now = name;
    try { localStorage.setItem("uwbbench-theme", name); } catch { /* private windows keep nothing */ }
  }
  button.hidden = false;
  button.addEventListener("click", () => setTheme(themes[(themes.indexOf(button.dataset.now) + 1) % 3]));
  setTheme(themes.includes(remembered()) ? remembered() : "auto");

  function make(tag, text, attributes = {}) {
    const element = document.createElement(tag);
    if (text !== undefined) element.textContent = text;
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  }

  // A number may have an interval, a remark or a total behind it; what starts with a digit otherwise is a name.
  const number = /^([-+<]?\d[\d.]*(?:e[-+]?\d+)?)(?: of \d+| [[(].*)?$/i;
  const keyOf = (cell) => {
    const text = cell.dataset.key ?? cell.textContent.trim();
    const match = number.exec(text);
    return match ? Number(match[1].replace("<", "")) : /^(n\/a|not (timed|known)$|none$|–$|$)/.test(text) ? null : text;
  };
  function sortBy(table, column, descending) {
    const body = table.tBodies[0], sign = descending ? -1 : 1;
    const rows = [...body.rows].map((row) => [keyOf(row.cells[column]), row]);
    rows.sort(([a, one], [b, other]) => {
      const last = ("last" in one.dataset) - ("last" in other.dataset);
      if (last) return last;
      if (a === null || b === null) return (a === null) - (b === null);
      if (typeof a === "number" && typeof b === "number") return sign * (a - b);
      return sign * String(a).localeCompare(String(b), "en", { numeric: true });
    });
    body.append(...rows.map(([, row]) => row));
    [...table.tHead.rows[0].cells].forEach((head, index) => {
      if (index === column) head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
  }
  function sortable(table) {
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const sort = make("button", head.textContent, { type: "button", title: "Sort by " + head.textContent });
      sort.addEventListener("click", () => {
        const up = head.getAttribute("aria-sort") === "ascending";
        const first = head.dataset.first === "descending" && !head.hasAttribute("aria-sort");
        sortBy(table, column, first || up);
      });
      head.replaceChildren(sort);
    });
  }
  for (const table of document.querySelectorAll("table.sortable")) {
    const rows = table.tBodies[0].rows;
    for (const row of rows) for (const cell of row.cells) if (typeof keyOf(cell) === "string" && !cell.querySelector("small")) {
      cell.classList.add("text");
      cell.classList.toggle("long", cell.textContent.length > 30);
    }
    [...table.tHead.rows[0].cells].forEach((head, column) => head.classList.toggle("text", rows[0].cells[column].classList.contains("text")));
    sortable(table);
  }
  // A table that is wider than the page says so: a shade at the edge where it goes on.
  function edges(box) {
    const inner = box.firstElementChild, rest = inner.scrollWidth - inner.clientWidth - inner.scrollLeft;
    box.classList.toggle("more", rest > 2);
    box.classList.toggle("moved", inner.scrollLeft > 2);
  }
  for (const box of document.querySelectorAll(".wide")) {
    box.append(make("span", "scroll \u2192", { class: "hint", "aria-hidden": "true" }));
    box.firstElementChild.addEventListener("scroll", () => edges(box), { passive: true });
    const watch = new ResizeObserver(() => edges(box));
    for (const part of [box, box.firstElementChild.firstElementChild]) watch.observe(part);
  }
  function markOf([path, colour]) {
    const names = "http://www.w3.org/2000/svg", drawn = document.createElementNS(names, "svg"), shape = document.createElementNS(names, "path");
    for (const [name, value] of [["class", "mark"], ["viewBox", "-8 -8 16 16"], ["aria-hidden", "true"]]) drawn.setAttribute(name, value);
    shape.setAttribute("d", path);
    shape.setAttribute("fill", colour);
    drawn.append(shape);
    return drawn;
  }
  return { root, make, sortBy, sortable, markOf };
})();
