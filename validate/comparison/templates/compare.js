"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { Place, drawForPaper, filled } = Figures;
  // Between halves that stand one below the other: an axis with its title, and for a plan its colours.
  const GAP_PX = 90;
  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false };

  class Plot extends Place {
    constructor(section, figure) {
      super(section.element, figure);
      this.section = section;
    }
    refresh() {
      if (!this.dirty) return;
      this.dirty = false;
      const chosen = { ...this.section.chosen, ...this.own };
      const lookup = (name) => {
        if (!(name in this.figure.columns)) throw new Error("no column " + name);
        return this.figure.columns[name];
      };
      const traces = this.figure.traces.map((trace) => filled(trace, lookup, chosen));
      const layout = filled(this.figure.layout, lookup, chosen);
      layout.height = layout.height || this.figure.height;
      if (this.narrow) this.forNarrow(layout, traces);
      this.draw(traces, layout, CONFIG);
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

  const sections = [...document.querySelectorAll("[data-section]")].map((element) => new Section(element));
  drawForPaper(() => sections.flatMap((section) => section.plots));
  document.documentElement.dataset.ready = String(Math.round(performance.now()));
})();
