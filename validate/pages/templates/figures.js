"use strict";
/** What the scripts of all pages have in common: figures that are drawn when they come into view, as wide as their room. */
const Figures = (() => {
  const NARROW_PX = 520;
  // Within the margins of A4 and of letter paper.
  const PRINTED_PX = 700;
  const drawing = { onPaper: false };

  /** A figure with what `lookup` gives for its columns put in; {…} in a column's name is the reader's choice. */
  function filled(value, lookup, chosen) {
    if (Array.isArray(value)) return value.length && typeof value[0] === "object" ? value.map((v) => filled(v, lookup, chosen)) : value;
    if (value === null || typeof value !== "object") return value;
    if ("$" in value) return lookup(value.$.replace(/\{(\w+)\}/g, (_, name) => chosen[name]));
    return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, filled(item, lookup, chosen)]));
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

  /** Notifies the `owner` of an element that comes into view or leaves it; who leaves does so first. */
  const watcher = new IntersectionObserver((entries) => {
    entries.forEach((entry) => { entry.target.owner.seen = entry.isIntersecting; });
    entries.filter((entry) => !entry.isIntersecting).forEach((entry) => entry.target.owner.leave?.());
    entries.filter((entry) => entry.isIntersecting).forEach((entry) => entry.target.owner.refresh());
  }, { rootMargin: "300px" });

  // A browser has few WebGL contexts, some only eight, and blanks the oldest figure without a word when they are used up.
  const MOST_SCENES = 4;
  const IN_SPACE = /^(scatter3d|mesh3d|surface|cone|streamtube|volume|isosurface)$/;
  /** The places whose figure in space is alive; the one that was drawn longest ago first. */
  const scenes = [];

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
      if (this.purging) { // anew, once plotly has done with what was there
        this.purging.then(() => { this.dirty = true; this.refresh(); });
        return;
      }
      const inSpace = traces.some((trace) => IN_SPACE.test(trace.type));
      if (this.picture) { this.picture = null; this.div.replaceChildren(); }
      if (inSpace && this.view && this.view.room === this.room) layout.scene = { ...layout.scene, camera: this.view.camera };
      this.drawnFor = this.room;
      this.div.style.minHeight = layout.height + "px";
      layout.autosize = !drawing.onPaper;
      if (drawing.onPaper) layout.width = Math.min(PRINTED_PX, this.div.clientWidth);
      const done = Plotly.react(this.div, asWords(traces), asWords(layout), config);
      this.drawing = done;
      done.then(() => { if (this.drawing === done) this.drawing = null; });
      if (inSpace) this.live();
    }
    /** Count among the scenes that are alive; the one drawn longest ago becomes a picture where there are too many. */
    live() {
      if (!this.counted) {
        this.counted = true;
        this.div.on("plotly_relayout", (event) => {
          if (event["scene.camera"]) this.view = { room: this.drawnFor, camera: event["scene.camera"] };
        });
      }
      const before = scenes.indexOf(this);
      if (before >= 0) scenes.splice(before, 1);
      scenes.push(this);
      while (scenes.length > MOST_SCENES) scenes[0].freeze();
    }
    /** Give the WebGL context back. */
    release() {
      if (!this.counted) return;
      this.counted = false;
      scenes.splice(scenes.indexOf(this), 1);
      // The contexts would otherwise live until the browser tidies up.
      this.div.querySelectorAll("canvas").forEach((canvas) => {
        const context = canvas.getContext("webgl");
        const end = context && context.getExtension("WEBGL_lose_context");
        if (end) end.loseContext();
      });
      this.div.replaceChildren();
      // Plotly ends a drawing after its call returned, and must find its figure then.
      if (this.drawing) this.purging = this.drawing.then(() => { Plotly.purge(this.div); this.purging = null; });
      else Plotly.purge(this.div);
      this.released();
    }
    /** What whoever extends this forgets with its figure. */
    released() {}
    /** Out of view: a figure in space is drawn anew when it comes back. */
    leave() {
      if (!this.counted) return;
      this.dirty = true;
      this.release();
    }
    /** Make a picture of a figure in space, which is drawn anew when it is touched or changed. */
    freeze() {
      const { scene } = this.div._fullLayout;
      const copy = this.div.querySelector(".plot-container").cloneNode(true);
      const canvas = copy.querySelector("canvas");
      if (canvas && scene && scene._scene) {
        const image = new Image();
        image.src = scene._scene.toImage("png");
        image.alt = "";
        image.style.cssText = canvas.style.cssText;
        canvas.replaceWith(image);
      }
      this.release();
      this.div.append(copy);
      this.picture = copy;
      const revive = () => { this.dirty = true; this.refresh(); };
      copy.addEventListener("pointerenter", revive, { once: true });
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
