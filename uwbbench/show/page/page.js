(async () => {
  const at = (id) => document.getElementById(id);
  if (!("DecompressionStream" in window)) { at("too-old").hidden = false; return; }
  // What charts and leaderboard are made of is compressed: base64 of a zlib stream of JSON.
  const bytes = Uint8Array.from(atob(at("data").textContent), (letter) => letter.charCodeAt(0));
  const data = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
  const config = JSON.parse(at("theme-config").textContent);
  const { root, make, sortBy, sortable, markOf } = base;

  function fill(select, options, keep) {
    select.replaceChildren(...options.map(([value, text]) => make("option", text, { value })));
    if (options.some(([value]) => value === keep)) select.value = keep;
    select.disabled = options.length < 2;
  }
  const distinct = (values) => [...new Set(values)];
  const shown = (value, digits, factor) => value === null ? "n/a" : (value * factor).toFixed(digits);

  // Charts -----------------------------------------------------------------------------------------------------
  const options = { mode: "vega-lite", renderer: "svg", actions: false, ast: true, defaultStyle: false, config, tooltip: { disableDefaultStyle: true } };
  const views = new Map();
  function wrapped(text, letters) {
    const lines = [""];
    for (const word of text.split(" ")) {
      if (lines.at(-1) && (lines.at(-1) + " " + word).length > letters) lines.push(word);
      else lines[lines.length - 1] += (lines.at(-1) ? " " : "") + word;
    }
    return lines;
  }
  // Legends take as many columns as there is room for, and charts grow by the lines that legend and title need.
  function legendLines(part, columns) {
    if (part === null || typeof part !== "object" || (Array.isArray(part) && part.length > 40)) return 0;
    let lines = 0;
    if (part.legend?.columns) {
      part.legend.columns = Math.min(columns, part.legend.columns);
      lines = Math.ceil((part.scale?.domain?.length ?? 1) / part.legend.columns);
    }
    return Math.max(lines, ...Object.values(part).map((inner) => legendLines(inner, columns)));
  }
  // Titles below a chart are broken into lines as its head is.
  function breakTitles(layers, letters) {
    for (const { layer, encoding } of layers) {
      if (layer) breakTitles(layer, letters);
      if (encoding?.x?.title?.length > letters) encoding.x.title = wrapped(encoding.x.title, letters);
    }
  }
  async function draw(place, spec, why) {
    views.get(place)?.finalize();
    views.delete(place);
    place.classList.toggle("empty", !spec);
    if (!spec) { place.textContent = why; return null; }
    place.replaceChildren();
    const fitted = structuredClone(spec), letters = Math.max(24, Math.floor(place.clientWidth / 8.2));
    const around = place.closest("[data-drive]") ?? place.closest("figure").parentElement;
    const head = { ...spec.title }, chosen = around.querySelector("label.single select")?.value;
    if (chosen !== undefined && spec.params) {
      fitted.params[0].value = chosen;
      for (const part of ["text", "subtitle"]) head[part] = head[part]?.replace("{detector}", () => chosen);
      const time = around.querySelector("input[type=range]");
      if (time) fitted.params[1].value = Number(time.value);
    }
    fitted.title.text = wrapped(head.text, letters);
    fitted.title.subtitle = wrapped(head.subtitle ?? "", letters * 1.12);
    breakTitles(fitted.layer, letters);
    const named = spec.layer.some((layer) => layer.encoding?.y?.type === "nominal");
    const columns = Math.max(1, Math.floor((place.clientWidth - (named ? 200 : 50)) / 150)), lines = fitted.title.text.length + fitted.title.subtitle.length - 2;
    fitted.height = spec.height + 15 * lines + 18 * Math.max(0, legendLines(fitted, columns) - 1);
    const made = await vegaEmbed(place, fitted, options);
    views.set(place, { ...made, finalize: made.finalize, source: spec });
    const picture = place.querySelector("svg");
    picture.setAttribute("role", "img");
    picture.setAttribute("aria-label", head.text + ". " + (head.subtitle ?? ""));
    for (const part of picture.querySelectorAll("[role], [aria-roledescription], [aria-label]")) {
      for (const name of ["role", "aria-roledescription", "aria-label", "aria-hidden"]) part.removeAttribute(name);
    }
    return made.view;
  }
  // Titles are broken into lines for the width they were drawn for: another width is drawn anew.
  let width = window.innerWidth, timer = 0;
  window.addEventListener("resize", () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    clearTimeout(timer);
    timer = setTimeout(() => { for (const [place, { source }] of views) later(() => draw(place, source)); }, 250);
  });
  let waiting = Promise.resolve();
  const later = (work) => { waiting = waiting.then(() => new Promise((go) => setTimeout(go, 0))).then(work); return waiting; };

  // Boards -----------------------------------------------------------------------------------------------------
  if (at("choose")) {
    const numberOf = (board) => data.boards.indexOf(board);
    const chosen = () => {
      const fits = data.boards.filter((board) => board.dataset === at("dataset").value);
      const scoring = fits.filter((board) => board.scoring === at("scoring").value);
      return scoring.find((board) => board.table === at("table").value) ?? scoring[0] ?? fits[0];
    };
    const plain = (values) => values.map((value) => [value, value]);

    function offer() {
      const of = data.boards.filter((board) => board.dataset === at("dataset").value);
      fill(at("scoring"), plain(distinct(of.map((board) => board.scoring))), at("scoring").value);
      const tables = of.filter((board) => board.scoring === at("scoring").value);
      fill(at("table"), plain(distinct(tables.map((board) => board.table))), at("table").value);
      const board = chosen();
      fill(at("metric"), board.charted.map((name) => [name, quantity(name).title]), at("metric").value);
      const cuts = Object.keys(board.cuts).map((key) => key.split("|"));
      for (const [id, values] of [["channel", distinct(cuts.map(([c]) => c))], ["material", distinct(cuts.map(([, m]) => m))]]) {
        const single = values.filter((value) => value !== "");
        fill(at(id), single.length < 2 ? [["", single[0] ?? "all"]] : values.map((value) => [value, value || "all"]), at(id).value);
      }
      const inside = data.spans.filter((span) => data.rows.some((row) => row[0] === numberOf(board) && row[3] === span));
      fill(at("span"), [["", "all"], ...plain(inside)], at("span").value);
    }
    const quantity = (name) => data.quantities.find((one) => one.name === name);

    const counted = ["captures", "frames (n)", "detections (n)"];
    const inserted = ([first, ...rest], times) => [first, ...times, ...rest];
    const headOf = (one) => one.unit ? `${one.title} (${one.unit})` : one.title;
    const columnsOf = (board) => [board.main, ...board.columns.filter((name) => name !== board.main)].map((name) => { const one = quantity(name); return { one, index: data.quantities.indexOf(one) }; });
    function cellOf(value, low, high, digits, factor, title) {
      const cell = make("td", shown(value, digits, factor));
      cell.dataset.key = value === null ? "n/a" : String(value);
      if (value === null) cell.classList.add("na");
      if (low !== null && high !== null) cell.append(make("small", `[${shown(low, digits, factor)}, ${shown(high, digits, factor)}]`));
      if (title) cell.title = title;
      return cell;
    }
    function timeCell([text, small, key, title]) {
      const cell = make("td", text, { title });
      cell.dataset.key = key === null ? "n/a" : String(key);
      if (key === null) cell.classList.add("na");
      if (small) cell.append(make("small", small));
      return cell;
    }
    function leaderboard() {
      const board = chosen(), number = numberOf(board);
      const cut = board.cuts[`${at("channel").value}|${at("material").value}`];
      const wanted = at("search").value.trim().toLowerCase();
      const rows = cut === undefined ? [] : data.rows.filter((row) => row[0] === number && `${row[1]}|${row[2]}` === cut && row[3] === at("span").value
        && data.detectors[row[4]].toLowerCase().includes(wanted));
      const columns = columnsOf(board);
      const table = at("board");
      const sorted = table.tHead ? [...table.tHead.rows[0].cells].find((head) => head.hasAttribute("aria-sort")) : null;
      const before = sorted && [sorted.textContent, sorted.getAttribute("aria-sort") === "descending"];
      const head = make("thead"), body = make("tbody"), line = make("tr");
      const scores = columns.map(({ one }) => [headOf(one), one.better === "higher" ? "descending" : "ascending"]);
      const times = data.timed.map((name) => [name, "ascending"]);
      for (const [name, first] of [["detector", "ascending"], ...inserted(scores, times), ...counted.map((name) => [name, "ascending"])]) {
        line.append(make("th", name, { scope: "col", "data-first": first }));
      }
      head.append(line);
      const best = columns.map(({ one, index }) => {
        const known = rows.filter((row) => row[8] && !data.bounds[row[4]]).map((row) => row[7][index][0]).filter((value) => value !== null);
        if (known.length < 2 || one.better === "zero") return null;
        return one.better === "higher" ? Math.max(...known) : Math.min(...known);
      });
      for (const row of rows) {
        const tr = make("tr"), values = row[7];
        if (data.bounds[row[4]]) tr.dataset.last = "yes";
        const who = make("th", undefined, { scope: "row" });
        who.append(markOf(data.marks[row[4]]), data.detectors[row[4]]);
        tr.append(who);
        const scored = columns.map(({ one, index }, place) => {
          const [value, low, high, n, groups] = values[index];
          const title = value === null ? "undefined here: nothing was retained, nothing was to be found, or too few samples" : `n = ${n} ${one.samples}, ${groups} groups`;
          const cell = cellOf(value, low, high, one.digits, one.factor, title);
          if (value !== null && value === best[place] && row[8] && !data.bounds[row[4]]) cell.classList.add("best");
          return cell;
        });
        const times = data.times[board.timing][row[4]] ?? data.timed.map(() => ["not timed", "", null, ""]);
        tr.append(...inserted(scored, times.map(timeCell)));
        for (const count of [row[5], row[6], row[9]]) tr.append(make("td", String(count)));
        body.append(tr);
      }
      table.replaceChildren(table.caption ?? make("caption", "Leaderboard", { class: "hidden" }), head, body);
      sortable(table);
      const first = quantity(board.main);
      const heads = [...table.tHead.rows[0].cells].map((cell) => cell.textContent);
      const column = before && heads.includes(before[0]) ? heads.indexOf(before[0]) : heads.indexOf(headOf(first));
      if (rows.length) sortBy(table, column, before && heads.includes(before[0]) ? before[1] : first.better === "higher");
      at("board-note").textContent = rows.length ? `${rows.length} detectors, ${board.dataset}, ${board.scoring} scoring, ${board.table}.`
        : cut === undefined ? "No capture of this dataset has this channel with this material." : "No row fits these filters.";
      for (const kind of ["warnings", "missing"]) at("board-" + kind).replaceChildren(...board[kind].map((text) => make("li", text)));
    }
    function drawBoard() {
      const board = chosen(), number = numberOf(board), metric = at("metric").value;
      for (const place of document.querySelectorAll("[data-chart]")) {
        const chart = data.charts[place.dataset.chart];
        if (chart) later(() => draw(place, chart.specs[number][metric] ?? chart.specs[number][""], chart.empty));
      }
    }
    fill(at("dataset"), plain(distinct(data.boards.map((board) => board.dataset))));
    for (const id of ["dataset", "scoring", "table"]) at(id).addEventListener("change", () => { offer(); leaderboard(); drawBoard(); });
    at("metric").addEventListener("change", drawBoard);
    for (const id of ["channel", "material", "span"]) at(id).addEventListener("change", leaderboard);
    at("search").addEventListener("input", leaderboard);
    for (const form of document.querySelectorAll("form")) form.addEventListener("submit", (event) => event.preventDefault());
    offer(); leaderboard(); drawBoard();
  }
  // Charts that do not depend on the board -------------------------------------------------------------------
  for (const place of document.querySelectorAll("[data-fixed]")) later(() => draw(place, data.fixed[place.dataset.fixed][Number(place.dataset.index)]));
  for (const look of document.querySelectorAll(".look")) {
    const specs = data.looks[Number(look.dataset.look)];
    for (const kind of ["radargram", "map"]) {
      const place = look.querySelector(`[data-chart=${kind}]`);
      if (!place) continue;
      place.closest("div:not(.chart)").querySelector("select")?.addEventListener("change", () => later(() => draw(place, specs[kind])));
      later(() => draw(place, specs[kind]));
    }
  }
  for (const drive of document.querySelectorAll("[data-drive]")) {
    const specs = data.drives[Number(drive.dataset.drive)], time = drive.querySelector("input[type=range]");
    const places = [...drive.querySelectorAll("[data-drawn]")];
    const drawn = () => { for (const place of places) later(() => draw(place, specs[place.dataset.drawn])); };
    drive.querySelector("select").addEventListener("change", drawn);
    time.addEventListener("input", () => {
      drive.querySelector("output").textContent = Number(time.value).toFixed(1) + " s";
      for (const place of places) views.get(place)?.view.signal("until", Number(time.value)).runAsync();
    });
    drawn();
  }

  later(() => { root.dataset.ready = "yes"; });
})();
