"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const say = (text) => {
    byId("trouble").textContent = text;
    byId("trouble").hidden = false;
  };

  // base64 of gzip -> bytes.
  async function unpack(text) {
    const packed = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  async function showFigures() {
    for (const image of document.querySelectorAll("img[data-packed]")) {
      const content = await unpack(image.dataset.packed);
      image.src = URL.createObjectURL(new Blob([content], { type: "image/svg+xml" }));
    }
  }

  for (const button of document.querySelectorAll(".enlarge")) {
    button.addEventListener("click", () => {
      const large = button.closest("figure").querySelector(".sheet").classList.toggle("large");
      button.setAttribute("aria-pressed", String(large));
    });
  }

  for (const slider of document.querySelectorAll(".compare input")) {
    const follow = () => slider.parentElement.style.setProperty("--at", `${slider.value}%`);
    slider.addEventListener("input", follow);
    follow(); // a browser may restore the position of an earlier visit
  }

  // What is folded away on the screen is unfolded on paper.
  let unfolded = [];
  addEventListener("beforeprint", () => {
    unfolded = [...document.querySelectorAll("details:not([open])")];
    for (const details of unfolded) details.open = true;
  });
  addEventListener("afterprint", () => {
    for (const details of unfolded) details.open = false;
  });

  // Rows of text cells; quoted cells may hold commas, quotes (doubled) and line breaks.
  function parseCsv(text) {
    const rows = [];
    let row = [];
    const cell = /(?:"((?:[^"]|"")*)"|([^",\r\n]*))(,|\r?\n|$)/gy;
    while (cell.lastIndex < text.length) {
      const [, quoted, plain, end] = cell.exec(text);
      row.push(quoted === undefined ? plain : quoted.replaceAll('""', '"'));
      if (end !== ",") {
        rows.push(row);
        row = [];
      }
    }
    return rows;
  }

  // The value of a cell, null if it is missing. An infinite number keeps its text, JSON having none.
  function valueOf(text, kind) {
    if (text === "") return null;
    if (kind === "truth") return text === "True";
    if (kind === "text") return text;
    const number = Number(text);
    return Number.isFinite(number) ? number : text;
  }

  const digits = { ms: 2, MiB: 1, "": 2 };
  function shownText(value, column) {
    if (value === null) return "";
    if (column.kind === "truth") return value ? "yes" : "no";
    if (typeof value !== "number") return String(value);
    const decimals = column.kind === "whole" && column.unit === "" ? 0 : digits[column.unit];
    const shown = value * column.factor;
    if (shown !== 0 && Math.abs(shown) < 0.5 * 10 ** -decimals) return shown.toExponential(1); // not as zero
    return shown.toLocaleString("en", { minimumFractionDigits: decimals, maximumFractionDigits: decimals });
  }

  function compare(one, other) {
    if (typeof one === "string" || typeof other === "string") return String(one).localeCompare(String(other), "en");
    return one - other;
  }

  async function showTable() {
    const columns = JSON.parse(byId("columns").textContent);
    const views = JSON.parse(byId("views").textContent);
    const csv = await unpack(byId("csv").textContent);
    const cells = parseCsv(new TextDecoder().decode(csv)).slice(1);
    const place = new Map(columns.map((column, index) => [column.name, index]));
    const points = cells.map((texts) => ({
      values: texts.map((text, index) => valueOf(text, columns[index].kind)),
      // Columns that are not shown are searched, too.
      text: texts.map((text, index) => (text && columns[index].name === "stands_for" ? `stand-in ${text}` : text)).join("\n").toLowerCase(),
    }));
    const table = byId("points");
    const [head, body] = [table.tHead, table.tBodies[0]];
    const filter = byId("filter");
    let view = views[0];
    let order = [...points];

    function drawHead() {
      const row = document.createElement("tr");
      for (const name of view.columns) {
        const column = columns[place.get(name)];
        const heading = document.createElement("th");
        heading.scope = "col";
        heading.dataset.column = name;
        if (column.kind === "whole" || column.kind === "real") heading.className = "number";
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = column.heading;
        button.title = column.unit ? `${name}, shown in ${column.unit}` : name;
        if (column.unit) {
          const unit = document.createElement("small");
          unit.textContent = column.unit;
          button.append(" ", unit);
        }
        button.addEventListener("click", () => sortBy(heading));
        heading.append(button);
        row.append(heading);
      }
      head.replaceChildren(row);
      table.classList.toggle("everything", view.name === "everything");
    }

    function drawRow(point) {
      const row = document.createElement("tr");
      if (point.values[place.get("status")] !== "ok") row.className = "unmeasured";
      for (const name of view.columns) {
        const column = columns[place.get(name)];
        const cell = document.createElement(name === view.columns[0] ? "th" : "td");
        if (cell.tagName === "TH") cell.scope = "row";
        const text = shownText(point.values[place.get(name)], column);
        if (column.kind === "whole" || column.kind === "real") cell.className = "number";
        else if (text.length > 40) cell.className = "long";
        cell.textContent = text;
        const original = name === "scene" ? point.values[place.get("stands_for")] : null;
        if (original !== null) {
          const remark = document.createElement("small");
          remark.textContent = `stand-in, not the paper’s ${original}`;
          cell.append(remark);
        }
        row.append(cell);
      }
      return row;
    }

    function drawBody() {
      const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
      const fits = (point) => words.every((word) => {
        const [name, value] = word.split(/=(.*)/s);
        if (value === undefined || !place.has(name)) return point.text.includes(word);
        const own = point.values[place.get(name)];
        return (own === null ? "" : String(own).toLowerCase()) === value;
      });
      const fitting = order.filter(fits);
      const shown = fitting.filter((point) => view.workloads === null || view.workloads.includes(point.values[place.get("workload")]));
      body.replaceChildren(...shown.map(drawRow));
      const others = fitting.length - shown.length;
      byId("shown").textContent = `${shown.length} of ${points.length} rows`
        + (others ? `; ${others} more of other workloads` : "");
    }

    function sortBy(heading) {
      const up = heading.getAttribute("aria-sort") !== "ascending";
      for (const other of head.querySelectorAll("[aria-sort]")) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      const at = place.get(heading.dataset.column);
      // What is missing comes last either way.
      order.sort((one, other) => {
        const [a, b] = [one.values[at], other.values[at]];
        if (a === null || b === null) return (a === null) - (b === null);
        return up ? compare(a, b) : compare(b, a);
      });
      drawBody();
    }

    byId("view").addEventListener("change", (event) => {
      view = views[Number(event.target.value)];
      order = [...points];
      drawHead();
      drawBody();
    });
    filter.addEventListener("input", drawBody);
    view = views[Number(byId("view").value)]; // may have been restored, too
    drawHead();
    drawBody();

    const objects = () => points.map((point) => JSON.stringify(
      Object.fromEntries(columns.map((column, index) => [column.name, point.values[index]])),
    ));
    const files = {
      csv: async () => ["text/csv", csv],
      parquet: async () => ["application/vnd.apache.parquet", await unpack(byId("parquet").textContent)],
      json: async () => ["application/json", `[\n${objects().join(",\n")}\n]\n`],
    };
    for (const button of document.querySelectorAll("[data-download]")) {
      button.addEventListener("click", async () => {
        const [type, content] = await files[button.dataset.download]();
        const link = document.createElement("a");
        link.href = URL.createObjectURL(new Blob([content], { type }));
        link.download = `table.${button.dataset.download}`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
      });
    }
  }

  if (typeof DecompressionStream === "undefined") {
    say("This browser cannot unpack the figures and the table (it lacks DecompressionStream); a newer one can.");
  } else {
    showFigures().then(showTable).catch((error) => say(`The figures or the table could not be unpacked: ${error}`))
      .finally(() => document.documentElement.setAttribute("data-ready", ""));
  }
})();
