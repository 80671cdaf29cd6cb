"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const NARROW_PX = 520;
  // Between halves that stand one below the other: an axis with its title, and for a plan its colours.
  const GAP_PX = 90;
  // Within the margins of A4 and of letter paper.
  const PRINTED_PX = 700;
  let printing = false;
  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false };

  /** A figure with its columns put in; {…} in a column's name is the reader's choice. */
  function filled(value, columns, chosen) {
    if (Array.isArray(value)) return value.length && typeof value[0] === "object" ? value.map((v) => filled(v, columns, chosen)) : value;
    if (value === null || typeof value !== "object") return value;
    if ("$" in value) {
      const name = value.$.replace(/\{(\w+)\}/g, (_, key) => chosen[key]);
      if (!(name in columns)) throw new Error("no column " + name);
      return columns[name];
    }
    return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, filled(item, columns, chosen)]));
  }

  const watcher = new IntersectionObserver((entries) => entries.forEach((entry) => {
    entry.target.owner.seen = entry.isIntersecting;
    if (entry.isIntersecting) entry.target.owner.refresh();
  }), { rootMargin: "300px" });

  class Plot {
    constructor(section, figure) {
      this.section = section;
      this.figure = figure;
      this.root = section.element.querySelector(`[data-figure="${figure.id}"]`);
      this.div = this.root.querySelector(".plot");
      this.own = {};
      this.dirty = true;
      this.root.querySelectorAll(`select[data-scope="${figure.id}"]`).forEach((select) => {
        this.own[select.dataset.choice] = select.value;
        select.addEventListener("change", () => { this.own[select.dataset.choice] = select.value; this.stale(); });
      });
      this.root.owner = this;
      watcher.observe(this.root);
      // A window that becomes narrow, or a phone that is turned.
      new ResizeObserver(() => { if (this.drawnFor && this.drawnFor !== this.room()) this.stale(); }).observe(this.div);
    }
    /** What the form of a figure depends on: "wide", or how narrow. */
    room() {
      const width = this.div.clientWidth;
      return printing ? "paper" : width < NARROW_PX ? `narrow ${Math.round(width / 20)}` : "wide";
    }
    stale() {
      this.dirty = true;
      if (this.seen) this.refresh();
    }
    refresh() {
      if (!this.dirty) return;
      this.dirty = false;
      const chosen = { ...this.section.chosen, ...this.own };
      const traces = this.figure.traces.map((trace) => filled(trace, this.figure.columns, chosen));
      const layout = filled(this.figure.layout, this.figure.columns, chosen);
      const narrow = this.div.clientWidth < NARROW_PX;
      this.drawnFor = this.room();
      layout.height = layout.height || this.figure.height;
      layout.autosize = !printing;
      if (printing) layout.width = Math.min(PRINTED_PX, this.div.clientWidth);
      if (narrow) this.forNarrow(layout, traces);
      this.div.style.minHeight = layout.height + "px";
      Plotly.react(this.div, traces, layout, CONFIG);
      const words = [...document.querySelectorAll("select")]
        .filter((s) => this.root.contains(s) || (s.dataset.scope === "section" && this.section.element.contains(s)))
        .map((s) => s.selectedOptions[0].textContent).join(", ");
      this.div.setAttribute("aria-label", this.figure.alt + (words ? ` Shown: ${words}.` : ""));
    }
    forNarrow(layout, traces) {
      layout.font = { ...(layout.font || {}), size: 11 };
      layout.margin = { ...layout.margin, l: 44, r: 8 };
      layout.legend = { ...layout.legend, font: { size: 10.5 } };
      for (const trace of traces)
        if (trace.marker && trace.marker.colorbar) trace.marker.colorbar = { ...trace.marker.colorbar, orientation: "h", y: -0.16,
          yanchor: "top", len: 0.9, thickness: 10, title: { ...trace.marker.colorbar.title, side: "top" } };
      if (layout.xaxis2) { // the halves stand one below the other
        layout.height = Math.round(1.75 * layout.height);
        layout.xaxis = { ...layout.xaxis, domain: [0, 1] };
        layout.xaxis2 = { ...layout.xaxis2, domain: [0, 1] };
        const gap = GAP_PX / layout.height;
        layout.yaxis = { ...layout.yaxis, domain: [0.5 + gap / 2, 1] };
        layout.yaxis2 = { ...layout.yaxis2, domain: [0, 0.5 - gap / 2], showticklabels: true };
      } else if (!layout.yaxis2) layout.height = Math.round(Math.min(layout.height, 1.05 * this.div.clientWidth + 80));
    }
  }

  class Section {
    constructor(element) {
      this.element = element;
      this.chosen = {};
      for (const [name, value] of Object.entries(element.dataset))
        if (name.startsWith("fixed")) this.chosen[name.slice(5).toLowerCase()] = value;
      this.plots = data.sections[Number(element.dataset.section)].figures.map((figure) => new Plot(this, figure));
      element.querySelectorAll('select[data-scope="section"]').forEach((select) => {
        this.chosen[select.dataset.choice] = select.value;
        select.addEventListener("change", () => {
          this.chosen[select.dataset.choice] = select.value;
          this.plots.forEach((plot) => plot.stale());
        });
      });
    }
  }

  /** All figures: as wide as paper is, or as the window. */
  function redraw(onPaper) {
    printing = onPaper;
    sections.forEach((section) => section.plots.forEach((plot) => {
      plot.dirty = true;
      if (onPaper || plot.seen) plot.refresh();
    }));
  }
  const sections = [...document.querySelectorAll("[data-section]")].map((element) => new Section(element));
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((details) => { details.open = true; });
    redraw(true);
  });
  window.addEventListener("afterprint", () => redraw(false));
  document.documentElement.dataset.ready = String(Math.round(performance.now()));
})();
