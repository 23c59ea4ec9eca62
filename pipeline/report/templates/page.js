"use strict";
// The page without any drawing: colour scheme, tables that sort, copy and download. All of it works without the network.

const pmg = {
  /** Bytes that stand in the page as base64 of raw deflate. */
  async bytes(base64, length = undefined) {
    const packed = Uint8Array.from(atob(base64.trim()), (letter) => letter.charCodeAt(0)).subarray(0, length);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  },
  /** The same as text. */
  async text(base64) {
    return new TextDecoder().decode(await pmg.bytes(base64));
  },
  /** An element with attributes and children; text never becomes markup. */
  make(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.append(...children);
    return element;
  },
  /** Said aloud by a screen reader, without moving the focus. */
  announce(words) {
    document.getElementById("announced").textContent = words;
  },
  /** Called whenever the colours of the page change. */
  recoloured: [],
  /** Whether the simulation is shown with the cause, and who is called when that changes. */
  caused: false,
  switched: [],
};

(() => {
  const root = document.documentElement;
  const button = document.getElementById("scheme");
  const words = { "": "as the system", light: "light", dark: "dark" };
  const show = () => {
    button.textContent = `Colours: ${words[root.dataset.theme ?? ""]}`;
    for (const follow of pmg.recoloured) follow();
  };
  button.hidden = false;
  button.addEventListener("click", () => {
    const next = { "": "light", light: "dark", dark: "" }[root.dataset.theme ?? ""];
    if (next) root.dataset.theme = next;
    else delete root.dataset.theme;
    show();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  show();
})();

(() => {
  const box = document.getElementById("with-cause");
  if (!box) return;
  box.closest("label").hidden = false;
  box.checked = false;
  box.addEventListener("change", () => {
    pmg.caused = box.checked;
    for (const follow of pmg.switched) follow();
    pmg.announce(box.checked ? "Simulated with the cause" : "Simulated with the plain model");
  });
})();

(() => {
  // What is folded away: opened together, and wherever a link leads into it.
  const folds = [...document.querySelectorAll("details.fold")];
  const button = document.getElementById("folds");
  const show = () => {
    const all = folds.every((fold) => fold.open);
    button.setAttribute("aria-pressed", String(all));
    button.textContent = all ? "Close details" : "Open details, also in print";
  };
  button.hidden = !folds.length;
  button.addEventListener("click", () => {
    const open = !folds.every((fold) => fold.open);
    for (const fold of folds) fold.open = open;
  });
  for (const fold of folds) fold.addEventListener("toggle", show);
  show();
  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
    const fold = target && target.closest("details.fold:not([open])");
    if (!fold) return;
    fold.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  reveal();
})();

(() => {
  /** What a cell sorts by: its number, else its text; the number of "1.2 ± 0.1" is the 1.2. */
  const key = (cell) => {
    const text = cell.textContent.trim();
    if (text === "–" || text === "") return null;
    const found = /^\(?([−-]?[\d.]+|∞)/.exec(text);
    if (!found || !cell.classList.contains("number")) return text;
    const power = /×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/.exec(text);
    const exponent = power ? Number([...power[1]].map((sign) => "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(sign)).map((n) => (n < 0 ? "-" : n)).join("")) : 0;
    return (found[1] === "∞" ? Infinity : Number(found[1].replace("−", "-"))) * 10 ** exponent;
  };
  const order = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));

  const sortable = (table) => {
    const body = table.tBodies[0];
    const given = [...body.rows];
    if (given.length < 2) return;
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      const press = pmg.make("button", { type: "button", class: "sort", title: "Sort by this column" });
      press.append(...head.childNodes);
      head.append(press);
      press.addEventListener("click", () => {
        const next = { ascending: "descending", descending: "none" }[head.getAttribute("aria-sort")] ?? "ascending";
        for (const other of heads) other.removeAttribute("aria-sort");
        let rows = given;
        if (next !== "none") {
          head.setAttribute("aria-sort", next);
          const keyed = given.map((row) => [key(row.cells[column]), row]);
          const known = keyed.filter(([value]) => value !== null).sort((a, b) => order(a[0], b[0]));
          if (next === "descending") known.reverse();
          rows = [...known, ...keyed.filter(([value]) => value === null)].map(([, row]) => row);
        }
        body.append(...rows);
        pmg.announce(next === "none" ? "Rows as they were" : `Sorted by ${press.textContent.trim()}, ${next}`);
      });
    });
  };

  const FEW = 8; // rows up to which a table is read at a glance
  const MOST_KINDS = 6; // different words in a column that a list offers
  const BOUND = /^([<>]=?)\s*([−-]?[\d.]+(?:e[+-]?\d+)?)$/i;

  /** A field that keeps the rows with all its words ("neutral -1092"), and a list for each column of few words. */
  const filterable = (figure, table) => {
    const rows = [...table.tBodies[0].rows];
    if (rows.length <= FEW) return;
    const heads = [...table.tHead.rows[0].cells].map((head) => head.querySelector(".heading").textContent);
    const bar = pmg.make("div", { class: "filter" });
    const field = pmg.make("input", { type: "search", placeholder: "Search rows", "aria-label": `Search rows of ${figure.dataset.title}` });
    const tally = pmg.make("span", { class: "found" });
    bar.append(field);
    const kept = [(row) => field.value.toLowerCase().split(/\s+/).every((word) => row.textContent.toLowerCase().includes(word))];
    const numbered = heads.map((name, column) => [name, column]).filter(([, column]) => rows.some((row) => row.cells[column]?.classList.contains("number")));
    heads.forEach((name, column) => {
      const kinds = [...new Set(rows.map((row) => row.cells[column]?.textContent ?? ""))];
      if (kinds.length < 2 || kinds.length > MOST_KINDS || numbered.some(([, other]) => other === column)) return;
      const list = pmg.make("select", { "aria-label": `${name}, of ${figure.dataset.title}` });
      list.append(pmg.make("option", { value: "" }, `${name}: all`), ...kinds.map((kind) => pmg.make("option", { value: kind }, kind)));
      kept.push((row) => !list.value || row.cells[column].textContent === list.value);
      bar.append(list);
    });
    if (numbered.length) {
      const list = pmg.make("select", { "aria-label": `Column of numbers, of ${figure.dataset.title}` });
      list.append(...numbered.map(([name, column]) => pmg.make("option", { value: column }, name)));
      const bound = pmg.make("input", { type: "text", class: "bound", placeholder: "> 1.5", "aria-label": `Bound such as > 1.5, of ${figure.dataset.title}` });
      kept.push((row) => {
        const found = BOUND.exec(bound.value.trim());
        if (!found) return true;
        const [value, limit] = [key(row.cells[Number(list.value)]), Number(found[2].replace("−", "-"))];
        if (typeof value !== "number") return false;
        return { "<": value < limit, "<=": value <= limit, ">": value > limit, ">=": value >= limit }[found[1]];
      });
      bar.append(list, bound);
    }
    bar.append(tally);
    bar.addEventListener("input", () => {
      let count = 0;
      for (const row of rows) {
        row.hidden = !kept.every((keep) => keep(row));
        count += row.hidden ? 0 : 1;
      }
      tally.textContent = count < rows.length ? `${count} of ${rows.length} rows` : "";
      pmg.announce(`${count} of ${rows.length} rows`);
    });
    figure.querySelector(".scroll").before(bar);
  };

  /** The table as text with tabs, as spreadsheets take it from the clipboard. */
  const copied = (table) =>
    [...table.rows]
      .filter((row) => !row.hidden)
      .map((row) => [...row.cells].map((cell) => cell.innerText.replace(/\s+/g, " ").replace("†", "").trim()).join("\t"))
      .join("\n");

  const copy = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const field = pmg.make("textarea");
      field.value = text;
      document.body.append(field);
      field.select();
      document.execCommand("copy");
      field.remove();
    }
  };

  for (const figure of document.querySelectorAll("figure.table")) {
    const table = figure.querySelector("table");
    sortable(table);
    filterable(figure, table);
    const press = pmg.make("button", { type: "button", class: "copy" }, "Copy");
    press.setAttribute("aria-label", `Copy table ${figure.dataset.title}`);
    press.addEventListener("click", async () => {
      await copy(copied(table));
      pmg.announce("Table copied");
      press.textContent = "Copied";
      setTimeout(() => (press.textContent = "Copy"), 1500);
    });
    const link = figure.querySelector("a.csv");
    link.after(" ", press);
    const packed = document.getElementById(`${figure.id}-csv`);
    link.addEventListener("click", async (event) => {
      if (typeof DecompressionStream === "undefined") return; // the file beside the page, then
      event.preventDefault(); // the page may have come alone, without the folder it was written to
      const file = new Blob([await pmg.bytes(packed.textContent)], { type: "text/csv" });
      const address = URL.createObjectURL(file);
      pmg.make("a", { href: address, download: `${figure.id}.csv` }).click();
      setTimeout(() => URL.revokeObjectURL(address), 1000);
    });
  }
})();
