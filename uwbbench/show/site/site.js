// The filter of a table: rows by the name of the detector, columns by that of the dataset.
for (const form of document.querySelectorAll("form.filters")) {
  const table = form.parentElement.querySelector("table"), value = (name) => form.querySelector(name).value.trim().toLowerCase();
  const filter = () => {
    const wanted = value(".rows"), columns = [...table.tHead.rows[0].cells].map((head, place) => place === 0 || head.textContent.toLowerCase().includes(value(".columns")));
    for (const row of table.rows) {
      if (row.parentElement !== table.tHead) row.hidden = !row.cells[0].textContent.toLowerCase().includes(wanted);
      columns.forEach((shown, place) => { row.cells[place].hidden = !shown; });
    }
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", filter);
}
base.root.dataset.ready = "yes";
