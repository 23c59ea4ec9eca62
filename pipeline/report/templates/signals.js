// The signals behind a point: opened by a click or by Enter on a cell, by the list, or by an address that ends in
// #point=NAME. Each point is unpacked when it is opened; the layout of its bytes is described where they are packed.

(() => {
  const listing = document.getElementById("signals-index");
  if (!listing || !pmg.library) return;
  const index = JSON.parse(listing.textContent);
  const packed = document.getElementById("signals-data").textContent;
  const simulated = JSON.parse(document.getElementById("signals-simulated")?.textContent ?? "null");
  /** The model that is shown. */
  const model = () => simulated.models[pmg.caused ? simulated.models.length - 1 : 0];
  const dialog = document.getElementById("signals");
  const select = dialog.querySelector("select");
  const body = dialog.querySelector(".body");
  /** Row of each point by its name; a further point of the same name has its count behind it. */
  const rows = new Map();
  for (const [row, cell] of index.cells.entries()) {
    let name = cell.point;
    for (let count = 2; rows.has(name); count += 1) name = `${cell.point} (${count})`;
    rows.set(name, row);
  }
  const names = [...rows.keys()].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
  const search = dialog.querySelector("input[type=search]");
  /** Name of the point that is shown; empty where none is. */
  let current = "";
  /** The list holds the points with all words of the search, and the one that is shown. */
  const list = () => {
    const words = search.value.toLowerCase().split(/\s+/);
    const shown = current;
    const label = (name) => (index.cells[rows.get(name)].accepted ? name : `${name}, rejected`);
    const found = names.filter((name) => name === shown || words.every((word) => label(name).toLowerCase().includes(word)));
    select.replaceChildren(...found.map((name) => pmg.make("option", { value: name }, label(name))));
    select.value = shown;
    return found.filter((name) => name !== shown || words.every((word) => name.toLowerCase().includes(word)));
  };
  list();
  search.addEventListener("input", () => pmg.announce(`${list().length} of ${names.length} points`));
  search.addEventListener("keydown", (event) => {
    const [first] = event.key === "Enter" ? list() : [];
    if (first) show(first);
  });

  // Each row of a table of points leads to the signals of its point.
  for (const figure of document.querySelectorAll("figure.table[data-points]")) {
    for (const row of figure.querySelectorAll("tbody tr")) {
      const cell = row.cells[0];
      const name = cell?.textContent.trim();
      if (rows.has(name)) cell.replaceChildren(pmg.make("a", { href: `#point=${encodeURIComponent(name)}` }, name));
    }
  }

  const unpack = async (row) => {
    const { at, length } = index.cells[row];
    const bytes = (await pmg.bytes(packed.slice((at / 3) * 4, Math.ceil((at + length) / 3) * 4), length)).buffer;
    const view = new DataView(bytes);
    const start = 4 + view.getUint32(0, true);
    const cell = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, start - 4)));
    const numbers = ([first, count, offset, scale, log]) =>
      Array.from({ length: count }, (_, k) => {
        const code = view.getInt16(start + 2 * (first + k), true);
        if (code === -32768) return null;
        const value = offset + scale * code;
        return log ? 10 ** value : value;
      });
    return { cell, numbers };
  };

  const short = (value, digits = 3) => (value === null ? "–" : value === "inf" ? "∞" : Number(Number(value).toPrecision(digits)).toString().replace("-", "−"));

  /** A value and its U, both to the second digit of U. */
  const measured = (value, expanded) => {
    if (typeof value !== "number" || !(expanded > 0) || expanded === Infinity) return short(value, 6);
    const places = Math.min(Math.max(1 - Math.floor(Math.log10(Number(expanded.toPrecision(2)))), 0), 20);
    const text = value.toFixed(places);
    return `${(Number(text) ? text : (0).toFixed(places)).replace("-", "−")} ± ${expanded.toFixed(places)} (95 %)`;
  };

  /** Middles of the bins before, within and after the window. */
  const times = ({ edges, bins }) => bins.flatMap((count, part) => Array.from({ length: count }, (_, k) => edges[part] + ((edges[part + 1] - edges[part]) * (k + 0.5)) / count));

  const paper = {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: "@ink" },
    hoverlabel: { bgcolor: "@soft", bordercolor: "@rule", font: { color: "@ink" } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: "@muted", activecolor: "@link" },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  };
  const axis = (more) => ({ gridcolor: "@rule", linecolor: "@muted", tickcolor: "@muted", zeroline: false, showline: true, ticks: "outside", automargin: true, ...more });

  /** Torques and speeds over time: least and largest value of each bin, the filtered signal, the window shaded. */
  const overTime = ({ cell, numbers }) => {
    const data = [];
    const count = cell.channels.length;
    const layout = {
      ...paper,
      margin: { l: 70, r: 14, t: 36, b: 46 },
      hovermode: "x unified",
      hoversubplots: "axis",
      grid: { rows: count, columns: 1, roworder: "top to bottom", ygap: 0.14 },
      xaxis: axis({ title: { text: "time from the start of the window [s]" }, anchor: `y${count > 1 ? count : ""}` }),
      shapes: [],
    };
    cell.channels.forEach((channel, place) => {
      const of = index.channels[place];
      const y = `y${place ? place + 1 : ""}`;
      layout[`yaxis${place ? place + 1 : ""}`] = axis({ title: { text: `${of.label}<br>[${of.unit}]` }, tickformat: "~g" });
      const at = times(channel);
      const family = { xaxis: "x", yaxis: y, type: "scatter", mode: "lines" };
      const colour = `@series-${place % 2 ? 1 : 0}`;
      const [low, high] = [numbers(channel.low), numbers(channel.high)];
      if (channel.low[0] === channel.high[0]) data.push({ ...family, x: at, y: low, name: "mean of a bin", showlegend: place === 2, line: { color: colour, width: 1 } });
      else {
        data.push({ ...family, x: at, y: low, name: "least", showlegend: false, line: { color: colour, width: 0.5 } });
        data.push({ ...family, x: at, y: high, name: "recorded, least to largest", showlegend: place === 0, fill: "tonexty", fillcolor: `${colour}/0.35`, line: { color: colour, width: 0.5 } });
      }
      const filtered = numbers(channel.filtered);
      const [from, to] = channel.span;
      const steps = filtered.map((_, k) => (filtered.length > 1 ? from + ((to - from) * k) / (filtered.length - 1) : from));
      data.push({ ...family, x: steps, y: filtered, name: "after the filter", showlegend: place === 0, line: { color: "@ink", width: 2 } });
      const value = simulated && place < 2 ? model().torque[place][cell.row] : null;
      if (value !== null) {
        const [begin, end] = [channel.edges[1], channel.edges[2]];
        const allowed = simulated.tolerance[place][cell.row];
        data.push({ ...family, x: [begin, end], y: [value, value], name: model().name, showlegend: place === 0, line: { color: "@attention", width: 2, dash: "dash" } });
        if (allowed !== null)
          data.push({ ...family, x: [begin, end, end, begin], y: [value - allowed, value - allowed, value + allowed, value + allowed], name: "tolerance", showlegend: place === 0, fill: "toself", fillcolor: "@attention/0.10", line: { width: 0 }, hoverinfo: "skip" });
      }
      layout.shapes.push({ type: "rect", xref: "x", yref: `${y} domain`, x0: channel.edges[1], x1: channel.edges[2], y0: 0, y1: 1, fillcolor: "@link/0.10", line: { width: 0 }, layer: "below" });
    });
    return [data, layout];
  };

  /** Amplitude against frequency of the channels that have a spectrum, with marks at the turns of both shafts. */
  const overFrequency = ({ cell, numbers }) => {
    const shown = cell.channels.map((channel, place) => [channel, index.channels[place]]).filter(([channel]) => channel.spectrum);
    const layout = { ...paper, margin: { l: 70, r: 14, t: 36, b: 46 }, hovermode: "closest", shapes: [], annotations: [] };
    layout.xaxis = axis({ title: { text: "frequency [Hz]" }, type: "log", dtick: 1, minor: { ticks: "outside", ticklen: 3 } });
    layout.yaxis = axis({ title: { text: shown.length ? `amplitude [${shown[0][1].unit}]` : "" }, type: "log", dtick: 1, exponentformat: "power", minor: { ticks: "outside", ticklen: 3 } });
    const data = shown.map(([channel, of], place) => ({
      type: "scatter",
      mode: "lines",
      name: of.label,
      x: numbers(channel.spectrum.frequency),
      y: numbers(channel.spectrum.amplitude),
      line: { color: `@series-${place}`, width: 1.5 },
    }));
    cell.turns_hz.forEach((turns, side) => {
      if (!turns) return;
      layout.shapes.push({ type: "line", x0: turns, x1: turns, yref: "paper", y0: 0, y1: 1, line: { color: `@series-${side}`, width: 1, dash: "dot" } });
      layout.annotations.push({ x: Math.log10(turns), yref: "paper", y: 1, yanchor: "bottom", showarrow: false, text: `${["sun", "ring"][side]} ${short(turns)} Hz`, font: { size: 11 } });
    });
    layout.legend = { orientation: "h", y: -0.2, yanchor: "top", x: 0 };
    return [data, layout];
  };

  const table = (caption, heads, lines) => {
    const made = pmg.make("table", {}, pmg.make("caption", {}, caption));
    const head = pmg.make("tr");
    for (const text of heads) head.append(pmg.make("th", { scope: "col" }, text));
    made.append(pmg.make("thead", {}, head));
    const rest = pmg.make("tbody");
    for (const line of lines) {
      const row = pmg.make("tr", line.total ? { class: "total" } : {});
      line.cells.forEach((text, at) => row.append(pmg.make("td", at > 1 ? { class: "number" } : {}, text)));
      rest.append(row);
    }
    made.append(rest);
    return pmg.make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption }, made);
  };

  /** Two cursors, and what each channel does between them, by the least and the largest value of each bin. */
  const ranged = ({ cell, numbers }, element, [data, layout]) => {
    const shaded = layout.shapes.length;
    const { edges } = cell.channels[0];
    const [from, to] = ["From", "To"].map((name, end) => {
      const given = { type: "range", min: edges[0], max: edges[3], step: (edges[3] - edges[0]) / 500, value: edges[end + 1], "aria-label": `${name} [s]` };
      return pmg.make("input", given);
    });
    const span = pmg.make("output");
    const place = pmg.make("div");
    const count = () => {
      const [start, stop] = [Number(from.value), Number(to.value)].sort((a, b) => a - b);
      span.textContent = `${short(start, 4)} to ${short(stop, 4)} s`;
      const lines = cell.channels.map((channel, at) => {
        const inside = times(channel).map((time, k) => [time, k]).filter(([time]) => time >= start && time <= stop).map(([, k]) => k);
        const [low, high] = [numbers(channel.low), numbers(channel.high)].map((values) => inside.map((k) => values[k]).filter((value) => value !== null));
        const middles = low.map((value, k) => (value + high[k]) / 2);
        const mean = middles.reduce((sum, value) => sum + value, 0) / middles.length;
        const tell = (value) => (Number.isFinite(value) ? short(value, 6) : "–");
        return { cells: [index.channels[at].label, index.channels[at].unit, tell(mean), tell(Math.min(...low)), tell(Math.max(...high)), String(inside.length)] };
      });
      place.replaceChildren(table("Between the cursors, from the bins drawn", ["signal", "unit", "mean of bin middles", "least", "largest", "bins"], lines));
      return [start, stop];
    };
    const move = () => {
      const lines = count().map((x) => ({ type: "line", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line: { color: "@attention", width: 1.5, dash: "dash" } }));
      pmg.plot(element, data, { ...layout, shapes: [...layout.shapes.slice(0, shaded), ...lines] });
    };
    for (const cursor of [from, to]) {
      cursor.addEventListener("input", count);
      cursor.addEventListener("change", move);
    }
    count();
    const bar = pmg.make("div", { class: "cursors" }, pmg.make("label", {}, "From ", from), pmg.make("label", {}, "to ", to), span);
    return [bar, place];
  };

  /** What the mean torque of each shaft is uncertain by. */
  const budgets = (cell) =>
    cell.budget.map((of, place) => {
      const known = index.budget[place];
      const milli = (value) => (typeof value === "number" ? short(value * 1e3) : short(value));
      const lines = known.rows.map((row, at) => ({ cells: [row.name, `${row.type}, ${row.common ? "common to all points" : "of this point"}`, milli(of.u[at]), short(of.dof[at])] }));
      lines.push({ total: true, cells: ["combined", `of this point ${milli(of.independent)}, common ${milli(of.common)}`, milli(of.combined), short(of.dof_effective)] });
      lines.push({ total: true, cells: ["expanded, 95 %", `factor ${short(of.factor)}`, milli(of.expanded), ""] });
      return table(`Uncertainty of the mean torque, ${known.side}: ${short(of.torque, 6)} N m`, ["contribution", "kind", "u [mN m]", "degrees of freedom"], lines);
    });

  const facts = (cell) => {
    const list = pmg.make("dl");
    const add = (label, value) => list.append(pmg.make("dt", {}, label), pmg.make("dd", {}, value));
    add("Window", cell.accepted ? "accepted" : `rejected: ${cell.reasons.join("; ") || "no reason kept"}`);
    if (cell.file) add("Recording", `${cell.file}, samples ${cell.samples[0]} to ${cell.samples[1]} at ${short(cell.rate_hz, 6)} Hz`);
    for (const flag of cell.flags) add("Remark", flag);
    cell.channels.forEach((channel, place) => {
      const of = index.channels[place];
      const unstated = channel.expanded === null ? ", no uncertainty stated" : "";
      add(`Mean ${of.label}`, `${measured(channel.mean, channel.expanded)}${unstated} ${of.unit}${channel.remark ? `; ${channel.remark}` : ""}`);
    });
    if (cell.lacking) add("Signals", cell.lacking);
    return list;
  };

  /** What is simulated at the point: torque and residual by each model, and the loss of each mechanism. */
  const simulation = ({ cell }) => {
    if (!simulated) return [];
    const { models, tolerance, expanded } = simulated;
    const milli = (value) => (value === null ? "–" : short(value * 1e3, 4));
    const sides = cell.budget.map((of, place) => [of.torque, place]).filter(([, place]) => models[0].torque[place][cell.row] !== null);
    const lines = sides.map(([torque, place]) => ({
      cells: [
        `${index.budget[place].side} torque`,
        "",
        short(torque, 5),
        ...models.flatMap(({ torque: of }) => [short(of[place][cell.row], 5), milli(torque - of[place][cell.row])]),
        milli(expanded[place][cell.row]),
        milli(tolerance[place][cell.row]),
      ],
    }));
    const heads = models.flatMap(({ name }) => [`${name} [N m]`, "residual [mN m]"]);
    const made = lines.length ? [table("Measured and simulated", ["reading", "", "measured [N m]", ...heads, "U of the residual [mN m]", "tolerance [mN m]"], lines)] : [];
    const names = [...new Set(models.flatMap(({ loss }) => Object.keys(loss)))];
    const loss = names.map((name) => ({ name, watts: models.map((of) => of.loss[name]?.[cell.row] ?? null) }));
    const sums = models.map((_, at) => loss.reduce((sum, { watts }) => sum + (watts[at] ?? 0), 0));
    const share = (watts, at) => (watts === null ? "–" : `${short(watts)} W, ${short((100 * watts) / sums[at], 2)} %`);
    const acting = loss.filter(({ watts }) => watts.some((value) => value));
    if (!acting.length) return made;
    const rows = acting.map(({ name, watts }) => ({ cells: [name, "", ...watts.map(share)] }));
    return [...made, table("Simulated loss by mechanism", ["mechanism", "", ...models.map(({ name }) => name)], rows)];
  };

  let shown = 0;
  const show = async (name) => {
    const turn = ++shown;
    const row = rows.get(name);
    const read = await unpack(row);
    if (turn !== shown) return;
    current = name;
    list();
    body.replaceChildren(facts(read.cell));
    if (read.cell.channels.length) {
      const signals = pmg.make("div", { class: "plot signals-time" });
      const spectrum = pmg.make("div", { class: "plot signals-spectrum" });
      const drawing = overTime(read);
      const range = ranged(read, signals, drawing);
      body.append(pmg.make("h3", {}, "Before and after the filter"), signals, ...range, pmg.make("h3", {}, "Spectrum of the window"), spectrum);
      await pmg.plot(signals, ...drawing);
      await pmg.plot(spectrum, ...overFrequency(read));
    }
    const made = simulation(read);
    if (made.length) body.append(pmg.make("h3", {}, "Simulation"), ...made);
    body.append(pmg.make("h3", {}, "Uncertainty"), ...budgets(read.cell));
    dialog.dataset.point = name;
    history.replaceState(null, "", `#point=${encodeURIComponent(name)}`);
    pmg.announce(`Signals of point ${name}`);
  };

  pmg.switched.push(() => current && dialog.open && show(current));

  let back = null;
  pmg.openPoint = async (name) => {
    if (!name) return;
    back ??= document.activeElement;
    if (!dialog.open) dialog.showModal();
    if (rows.has(name)) await show(name);
    else lacking(name);
  };
  /** Says that there is no such point; the list above is there to choose another. */
  const lacking = (name) => {
    const missing = `This report holds no signals of a point named ${name}.`;
    shown += 1;
    pmg.forget(body);
    body.replaceChildren(pmg.make("p", { class: "lacking" }, missing));
    current = "";
    list();
    pmg.announce(missing);
  };
  const step = (by) => {
    const at = names.indexOf(current);
    const from = at >= 0 ? at : by > 0 ? -1 : names.length;
    return show(names[(from + by + names.length) % names.length]);
  };

  select.addEventListener("change", () => show(select.value));
  dialog.querySelector(".before").addEventListener("click", () => step(-1));
  dialog.querySelector(".after").addEventListener("click", () => step(1));
  dialog.querySelector(".close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => {
    pmg.forget(body);
    body.replaceChildren();
    delete dialog.dataset.point;
    history.replaceState(null, "", location.pathname + location.search);
    back?.focus?.({ preventScroll: true });
    back = null;
  });
  const opener = document.getElementById("open-signals");
  opener.hidden = false;
  opener.addEventListener("click", () => pmg.openPoint(names[0]));

  const follow = () => {
    const named = /^#point=(.+)$/.exec(location.hash);
    if (!named) return;
    let name = named[1];
    try {
      name = decodeURIComponent(name);
    } catch {
      // not an escaped name: taken as it stands
    }
    pmg.openPoint(name);
  };
  addEventListener("hashchange", follow);
  follow();
})();
