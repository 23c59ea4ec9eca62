// Figures: each is drawn by Plotly when it comes near the screen; until then, in print, and where that cannot be, the
// still drawing stands in its place.

(() => {
  const packed = document.getElementById("plotly");
  if (!packed || typeof DecompressionStream === "undefined") return;

  let library = null;
  /** The drawing library, unpacked once, when it is first needed. */
  pmg.library = () =>
    (library ??= pmg.text(packed.textContent).then((text) => {
      const script = document.createElement("script");
      script.textContent = text;
      document.head.append(script);
      return window.Plotly;
    }));

  const coloured = /^@([a-z0-9-]+)(?:\/([\d.]+))?$/;
  /** A specification with the colours of the page in place of their roles. */
  pmg.paint = (value) => {
    const style = getComputedStyle(document.documentElement);
    const paint = (given) => {
      if (typeof given === "string") {
        const role = coloured.exec(given);
        if (!role) return given;
        const hex = style.getPropertyValue(`--${role[1]}`).trim();
        const [r, g, b] = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
        return `rgba(${r},${g},${b},${role[2] ?? 1})`;
      }
      if (Array.isArray(given)) return given.map(paint);
      if (given && typeof given === "object") return Object.fromEntries(Object.entries(given).map(([name, inner]) => [name, paint(inner)]));
      return given;
    };
    return paint(value);
  };

  const config = {
    responsive: true,
    displaylogo: false,
    showTips: false,
    showSendToCloud: false,
    plotlyServerURL: "",
    displayModeBar: "hover",
    modeBarButtonsToRemove: ["select2d", "lasso2d"],
    toImageButtonOptions: { format: "png", scale: 2 },
  };
  let drawn = [];
  /** Draw into an element, and again whenever the colours change. */
  pmg.plot = async (element, data, layout) => {
    const plotly = await pmg.library();
    const known = drawn.find((plot) => plot.element === element);
    const plot = known ?? { element };
    Object.assign(plot, { data, layout: { ...layout, uirevision: layout.uirevision ?? "kept" } });
    if (!known) drawn.push(plot);
    const way = known ? plotly.react : plotly.newPlot;
    await way(element, pmg.paint(plot.data), pmg.paint(plot.layout), config);
  };
  /** Nothing within an element is drawn any more. */
  pmg.forget = (element) => {
    drawn = drawn.filter((plot) => !element.contains(plot.element));
  };
  pmg.recoloured.push(() => drawn.forEach((plot) => pmg.plot(plot.element, plot.data, plot.layout)));

  /** Arrow keys move over the cells of a map, Enter opens the point behind one. */
  const walkable = (element, panel, title) => {
    let column = 0;
    let row = 0;
    element.tabIndex = 0;
    element.setAttribute("role", "application");
    const opens = panel.points.length > 0 && "openPoint" in pmg;
    element.setAttribute("aria-label", `${title}. Arrow keys move over the cells${opens ? ", Enter opens the signals of a point" : ""}.`);
    const outline = (shown) => {
      const shape = {
        type: "rect",
        x0: panel.x_edges[column],
        x1: panel.x_edges[column + 1],
        y0: panel.y_edges[row],
        y1: panel.y_edges[row + 1],
        line: { color: pmg.paint("@ink"), width: 3 },
      };
      window.Plotly.relayout(element, { shapes: shown ? [shape] : [] });
    };
    const tell = () => {
      outline(true);
      const value = (pmg.caused && panel.switched_told ? panel.switched_told : panel.told)[row][column] ?? "not measured";
      pmg.announce(`${panel.x_label} ${panel.x[column]}, ${panel.y_label} ${panel.y[row]}: ${value}`);
    };
    element.addEventListener("focus", tell);
    element.addEventListener("blur", () => outline(false));
    element.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (step) {
        column = Math.min(Math.max(column + step[0], 0), panel.x.length - 1);
        row = Math.min(Math.max(row + step[1], 0), panel.y.length - 1);
        tell();
      } else if ((event.key === "Enter" || event.key === " ") && opens) {
        pmg.openPoint?.(panel.points[row][column]);
      } else return;
      event.preventDefault();
    });
  };

  const timed = new Map();
  /** What is under the pointer in one plot over time is told at the same time in the others on the screen. */
  const linked = (element, panel) => {
    const label = panel.layout.xaxis?.title?.text ?? "";
    if (!label.startsWith("time")) return;
    timed.set(element, label);
    const others = () => [...timed].filter(([other, with_]) => other !== element && with_ === label && other.isConnected).map(([other]) => other);
    const seen = (other) => {
      const box = other.getBoundingClientRect();
      return box.bottom > 0 && box.top < innerHeight;
    };
    // Only a pointer moves the others: what a script tells carries no event of its own and goes no further.
    element.on("plotly_hover", (event) => {
      if (!(event.event instanceof Event) || !event.points.length) return;
      const time = event.points[0].x;
      for (const other of others().filter(seen)) window.Plotly.Fx.hover(other, { xval: time, hovermode: "x" });
    });
    element.on("plotly_unhover", (event) => {
      if (event.event instanceof Event) for (const other of others()) window.Plotly.Fx.unhover(other, {});
    });
  };

  const place = async (holder, panel, title, name) => {
    const element = pmg.make("div", { class: "plot" });
    if (panel.choices) {
      const select = pmg.make("select", { id: `${name}-choice` });
      for (const choice of panel.choices) select.append(pmg.make("option", { value: choice.name }, choice.name));
      select.value = panel.shown;
      holder.append(pmg.make("label", { class: "choice", for: `${name}-choice` }, "Point ", select), element);
      const words = holder.closest("figure").querySelector(".caption");
      const given = words.textContent;
      const show = () => {
        const chosen = panel.choices.find((choice) => choice.name === select.value);
        words.textContent = chosen.caption || given;
        return pmg.plot(element, [], { ...panel.layout, ...chosen.layout, uirevision: chosen.name });
      };
      select.addEventListener("change", show);
      await show();
      return;
    }
    holder.append(element);
    const data = () => (!pmg.caused ? panel.data : (panel.switched ?? (panel.changed ? panel.data.map((trace, at) => ({ ...trace, ...panel.changed[at] })) : panel.data)));
    await pmg.plot(element, panel.data, panel.layout);
    if (panel.switched || panel.changed) {
      // The axes stay as they are without the cause, so that the eye can compare.
      const { xaxis, yaxis } = element._fullLayout;
      const layout = { ...panel.layout, xaxis: { ...panel.layout.xaxis, range: [...xaxis.range] }, yaxis: { ...panel.layout.yaxis, range: [...yaxis.range] } };
      const follow = () => pmg.plot(element, data(), layout);
      pmg.switched.push(follow);
      if (pmg.caused) await follow();
    }
    if (panel.kind === "map") walkable(element, panel, title);
    if (panel.kind === "chart") linked(element, panel);
    element.on("plotly_click", (event) => {
      const point = event.points[0]?.customdata;
      if (point) pmg.openPoint?.(point);
    });
  };

  const bring = async (figure) => {
    const still = figure.querySelector(".still");
    const specification = JSON.parse(figure.querySelector("script.live-data").textContent);
    // Surfaces need WebGL; where a browser has none, the still drawing stays.
    if (specification.panels.some((panel) => panel.kind === "surface") && !document.createElement("canvas").getContext("webgl")) return;
    const narrow = matchMedia("(max-width: 43rem)").matches;
    const columns = narrow ? 1 : Math.min(specification.columns, specification.panels.length);
    const rows = Math.ceil(specification.panels.length / columns);
    const height = Math.max(still.getBoundingClientRect().height / rows, narrow ? 440 : 260);
    const words = figure.querySelector(".caption");
    const given = words.textContent;
    const caption = () => (words.textContent = pmg.caused && specification.caption ? specification.caption : given);
    if (specification.caption) {
      pmg.switched.push(caption);
      caption();
    }
    const live = pmg.make("div", { class: "live" });
    live.style.setProperty("--columns", columns);
    live.style.setProperty("--panel-height", `${height}px`);
    still.after(live); // behind the still drawing, until it is whole
    try {
      for (const [index, panel] of specification.panels.entries()) {
        const holder = pmg.make("div", { class: `panel ${panel.kind}` });
        live.append(holder);
        await place(holder, panel, `${figure.dataset.title}${panel.layout.title ? `, ${panel.layout.title.text}` : ""}`, `${figure.id}-${index}`);
      }
      figure.classList.add("alive");
      figure.dataset.drawn = "yes";
    } catch (problem) {
      live.remove();
      console.error(problem);
    }
  };

  const near = new IntersectionObserver(
    (entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        near.unobserve(entry.target);
        bring(entry.target);
      }
    },
    { rootMargin: "500px" },
  );
  for (const figure of document.querySelectorAll("figure.drawn")) near.observe(figure);
})();
