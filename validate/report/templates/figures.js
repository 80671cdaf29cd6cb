"use strict";
/** What the scripts of all pages have in common: figures that are drawn when they come into view, as wide as their room. */
const Figures = (() => {
  const NARROW_PX = 520;
  // Within the margins of A4 and of letter paper.
  const PRINTED_PX = 700;
  const drawing = { onPaper: false };

  /** A figure with what `look` gives for its columns put in; {…} in a column's name is the reader's choice. */
  function filled(value, look, chosen) {
    if (Array.isArray(value)) return value.length && typeof value[0] === "object" ? value.map((v) => filled(v, look, chosen)) : value;
    if (value === null || typeof value !== "object") return value;
    if ("$" in value) return look(value.$.replace(/\{(\w+)\}/g, (_, name) => chosen[name]));
    return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, filled(item, look, chosen)]));
  }

  // Plotly reads tags in these, and they hold words of users; in templates of hovering it does so as well, which are ours.
  const WORDS = new Set(["name", "text", "ticktext", "customdata", "meta"]);

  /** The same with every sign of markup in words drawn as it stands; a line break is a new line. */
  function asWords(value, key) {
    if (typeof value === "string")
      return WORDS.has(key) ? value.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll("\n", "<br>") : value;
    if (Array.isArray(value)) return WORDS.has(key) || typeof value[0] === "object" ? value.map((item) => asWords(item, key)) : value;
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, asWords(item, name)]));
  }

  /** Tells the `owner` of an element that it comes into view. */
  const watcher = new IntersectionObserver((entries) => entries.forEach((entry) => {
    entry.target.owner.seen = entry.isIntersecting;
    if (entry.isIntersecting) entry.target.owner.refresh();
  }), { rootMargin: "300px" });

  /** A figure in its place, with the controls that are its own; whoever extends it has `refresh`. */
  class Place {
    constructor(section, figure) {
      this.figure = figure;
      this.root = section.querySelector(`[data-figure="${figure.id}"]`);
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
      new ResizeObserver(() => { if (this.drawnFor && this.drawnFor !== this.room) this.stale(); }).observe(this.div);
    }
    get narrow() { return !drawing.onPaper && this.div.clientWidth < NARROW_PX; }
    /** What the form of a figure depends on: "paper", "wide", or how narrow. */
    get room() {
      return drawing.onPaper ? "paper" : this.narrow ? `narrow ${Math.round(this.div.clientWidth / 20)}` : "wide";
    }
    stale() {
      this.dirty = true;
      if (this.seen && !this.waiting) {
        this.waiting = true;
        requestAnimationFrame(() => { this.waiting = false; this.refresh(); });
      }
    }
    /** Draw; `layout` has its height. */
    draw(traces, layout, config) {
      this.drawnFor = this.room;
      this.div.style.minHeight = layout.height + "px";
      layout.autosize = !drawing.onPaper;
      if (drawing.onPaper) layout.width = Math.min(PRINTED_PX, this.div.clientWidth);
      Plotly.react(this.div, asWords(traces), asWords(layout), config);
    }
  }

  /** Before paper is printed all that `parts` gives is drawn as wide as it is; afterwards what is in view, as the window. */
  function drawForPaper(parts) {
    const redraw = (onPaper) => {
      drawing.onPaper = onPaper;
      parts().forEach((part) => {
        part.dirty = true;
        if (onPaper || part.seen) part.refresh();
      });
    };
    window.addEventListener("beforeprint", () => {
      document.querySelectorAll("details").forEach((details) => { details.open = true; });
      redraw(true);
    });
    window.addEventListener("afterprint", () => redraw(false));
  }

  return { Place, drawForPaper, filled, watcher };
})();
