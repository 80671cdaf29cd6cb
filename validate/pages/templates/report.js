"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { Place, drawForPaper, filled, watcher } = Figures;
  // Three degrees of freedom, 95 %: the ellipsoid's half axes in standard deviations.
  const ELLIPSOID = 2.7955;
  const ELLIPSOID_M = 0.6;
  const ERROR_SHARE = 0.03;
  const ALL_CAMERAS = "*";
  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false };
  const CONFIG_3D = { displaylogo: false, responsive: true, displayModeBar: "hover", modeBarButtons: [["toImage", "zoom3d", "pan3d", "orbitRotation", "tableRotation", "resetCameraDefault3d"]] };

  // ---- columns ----------------------------------------------------------------------------------------------------

  /** The value of a column at a step: of the figure, or of the last step that set it. */
  function column(sweep, figure, step, name) {
    if (name in figure.columns) return figure.columns[name];
    for (let i = step; i >= 0; i--) if (name in sweep.steps[i]) return sweep.steps[i][name];
    throw new Error("no column " + name);
  }

  // ---- one sweep --------------------------------------------------------------------------------------------------

  class Sweep {
    constructor(section) {
      this.section = section;
      this.data = data.sweeps[Number(section.dataset.sweep)];
      this.place = this.data.first;
      this.shared = {};
      this.marker = null;
      this.slider = section.querySelector("[data-step]");
      this.plots = this.data.figures.map((figure) => new Plot(this, figure));
      this.pictures = new Pictures(this);
      section.querySelectorAll('select[data-scope="sweep"]').forEach((select) => {
        this.shared[select.dataset.choice] = select.value;
        select.addEventListener("change", () => {
          this.shared[select.dataset.choice] = select.value;
          this.changed();
        });
      });
      this.slider.addEventListener("input", () => { this.pause(); this.go(Number(this.slider.value)); });
      // Taken where it stands already: there is no input then.
      this.slider.addEventListener("pointerdown", () => this.pause());
      this.slider.addEventListener("keydown", (event) => { if (/^(Arrow|Home|End|Page)/.test(event.key)) this.pause(); });
      section.querySelectorAll("[data-go]").forEach((button) =>
        button.addEventListener("click", () => { this.pause(); this.go(this.place + Number(button.dataset.go)); }));
      this.button = section.querySelector("[data-play]");
      this.speed = section.querySelector("[data-speed]");
      this.button.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
      this.go(this.place);
    }
    /** The steps that the slider goes through, and the one that it shows. */
    get course() { return this.data.courses[this.data.course_of.map((name) => this.shared[name]).join("|")]; }
    get step() { return this.course[this.place]; }
    get label() { return this.data.labels[this.place]; }
    /** " at" the step, where there are several. */
    get where() { return this.data.labels.length > 1 ? ` at ${this.label}` : ""; }
    go(place) {
      this.place = Math.min(Math.max(place, 0), this.data.labels.length - 1);
      this.slider.value = this.place;
      this.slider.setAttribute("aria-valuetext", this.label);
      this.section.querySelector("[data-label]").textContent = this.label;
      this.changed();
    }

    // Playing never begins by itself; it goes round until it is stopped, or until the reader takes the slider.
    play() {
      this.playing = true;
      this.says("Pause", "off");
      this.next(this.turn = (this.turn || 0) + 1);
    }
    pause() {
      if (!this.playing) return;
      this.playing = false;
      clearTimeout(this.timer);
      this.says("Play", "polite");
    }
    /** The next step of a turn of playing, unless it was paused, or paused and begun anew. */
    next(turn) {
      if (!this.playing || turn !== this.turn) return;
      this.go((this.place + 1) % this.data.labels.length);
      const due = performance.now() + 1000 / Number(this.speed.value);
      // Two frames on, what the step changed has been drawn: a slow machine plays slowly, and stays in hand.
      requestAnimationFrame(() => requestAnimationFrame(() => {
        this.timer = setTimeout(() => this.next(turn), Math.max(0, due - performance.now()));
      }));
    }
    says(words, live) {
      this.button.querySelector("[data-words]").textContent = words;
      this.button.setAttribute("aria-label", `${words} the steps of ${this.data.name}`);
      this.button.classList.toggle("playing", this.playing);
      this.section.querySelectorAll("[data-label], [data-description], [data-view-description]").forEach((part) => part.setAttribute("aria-live", live));
    }
    changed() {
      this.plots.forEach((plot) => plot.stale());
      this.pictures.stale();
    }
    at(name) { return column(this.data, { columns: {} }, this.step, name); }
  }

  // ---- figures ----------------------------------------------------------------------------------------------------

  class Plot extends Place {
    constructor(sweep, figure) {
      super(sweep.section, figure);
      this.sweep = sweep;
      this.drawn = false;
      if (figure.id === "scene") this.scene();
    }
    scene() {
      this.layers = new Set();
      this.root.querySelectorAll("[data-layer]").forEach((box) => {
        const note = () => this.layers[box.checked ? "add" : "delete"](box.dataset.layer);
        note();
        box.addEventListener("change", () => { note(); this.stale(); });
      });
      this.list = this.root.querySelector("[data-marker]");
      this.list.addEventListener("change", () => this.pick(this.list.value === "" ? null : Number(this.list.value)));
    }
    pick(marker) {
      this.sweep.marker = marker;
      this.list.value = marker === null ? "" : String(marker);
      this.stale();
    }
    released() { this.drawn = false; }
    refresh() {
      if (!this.dirty) return;
      this.dirty = false;
      const chosen = { ...this.sweep.shared, ...this.own };
      const lookup = (name) => column(this.sweep.data, this.figure, this.sweep.step, name);
      let traces = this.figure.traces
        // Plotly keeps what it drew under a trace's uid, or else its place: a mesh would take over the colours of another.
        .map((t, n) => ({ ...t, uid: `${this.figure.id}-${n}` }))
        .filter((t) => Object.entries(t.when || {}).every(([name, value]) => chosen[name] === value))
        .map(({ when, ...trace }) => filled(trace, lookup, chosen));
      const layout = filled(this.figure.layout, lookup, chosen);
      if (this.figure.id === "scene") traces = this.inSpace(traces, chosen);
      const { narrow } = this;
      layout.height = narrow ? Math.round(Math.min(this.figure.height, 1.05 * this.div.clientWidth + 60)) : this.figure.height;
      if (narrow) this.forNarrow(layout, traces);
      try {
        this.draw(traces, layout, this.figure.id === "scene" ? CONFIG_3D : CONFIG);
      } catch (error) {
        this.div.innerHTML = '<p class="nogl">This browser draws no 3D figures; the tables have the numbers.</p>';
      }
      if (!this.drawn && this.figure.id === "scene")
        this.div.on("plotly_click", (event) => {
          const point = event.points[0];
          if (point.data.meta && point.data.meta.pick) this.pick(point.pointNumber);
        });
      this.drawn = true;
      const words = Object.values(chosen).join(", ");
      this.div.setAttribute("aria-label", `${this.figure.alt} Shown: ${this.sweep.label}, ${words}.`);
    }
    forNarrow(layout, traces) {
      layout.font = { ...(layout.font || {}), size: 11 };
      if (layout.margin && layout.margin.l) layout.margin = { ...layout.margin, l: 44, r: 8 };
      if (layout.legend) layout.legend = { ...layout.legend, font: { size: 10.5 } };
      for (const trace of traces) {
        const owner = trace.colorbar ? trace : trace.marker && trace.marker.colorbar ? trace.marker : null;
        if (!owner) continue;
        // Below the axis with its numbers and title, where there is one.
        const below = this.figure.id === "scene" ? -0.02 : -0.2;
        owner.colorbar = { ...owner.colorbar, orientation: "h", y: below, yanchor: "top", len: 0.9, thickness: 10,
          title: { ...owner.colorbar.title, side: "top" } };
        if (layout.margin) layout.margin = { ...layout.margin, b: 110 };
      }
      if (this.figure.id === "scene") { 
        layout.margin = { l: 0, r: 0, t: 0, b: 60 };
        layout.showlegend = false;
        layout.scene = { ...layout.scene, camera: layout.meta.narrow_camera };
      }
    }

    // ---- the scene in space ---------------------------------------------------------------------------------------

    inSpace(traces, chosen) {
      const at = (name) => this.sweep.at(name);
      const kept = traces.filter((t) => {
        const layer = t.meta && t.meta.layer;
        return !["frusta", "planes", "objects"].includes(layer) || this.layers.has(layer);
      });
      this.coloured(kept, at, chosen);
      const description = this.root.querySelector("[data-description]");
      const marker = this.sweep.marker;
      const centres = ["x", "y", "z"].map((axis) => at("centres_" + axis));
      const centre = (n) => centres.map((values) => values[n]);
      if (this.layers.has("sight")) 
        kept.push({ ...this.lines(at, centre, centres[0].map((_, n) => n), 1, "rgba(60,60,60,0.25)"), uid: "all-sight" });
      if (marker === null || marker >= centres[0].length) {
        description.textContent = "No marker is chosen.";
        return kept;
      }
      kept.push({ ...this.lines(at, centre, [marker], 5, "#111111"), uid: "sight" });
      const names = at("camera_names"), should = at("should_see"), rate = at("found_rate");
      const seeing = names.filter((_, c) => should[c][marker] === "1");
      const found = names.map((name, c) => [name, rate[c][marker]]).filter(([, r]) => r > 0);
      let words = kept.find((t) => t.meta && t.meta.pick).text[marker].replace("\n", ": ") + ". ";
      words += seeing.length ? `Should be seen by camera${seeing.length > 1 ? "s" : ""} ${seeing.join(", ")}; ` : "No camera should see it; ";
      words += found.length ? "found by " + found.map(([n, r]) => `${n} (${Math.round(100 * r)} % of trials)`).join(", ") + ". " : "found by none. ";
      const root = at(`root|${chosen.kind}|${chosen.model}`)[marker];
      if (root === null) words += "Not observable: there is no ellipsoid.";
      else {
        const size = ELLIPSOID * Math.hypot(...root) / 1000;
        const wanted = ELLIPSOID_M / size, power = 10 ** Math.floor(Math.log10(wanted));
        const times = power * [5, 2, 1].find((digit) => digit * power <= wanted * 1.0001);
        kept.push({ ...ellipsoid(centre(marker), root, times), uid: "ellipsoid" });
        words += `Its predicted 95 % ellipsoid is drawn ${times.toLocaleString("en")} times as large.`;
      }
      description.textContent = words;
      return kept;
    }
    /** Shades of the plates, signs and words of the dots: by what was predicted and measured of each marker. */
    coloured(traces, at, chosen) {
      const { colour, kind, model } = chosen;
      const predicted = at(`predicted|${kind}|${model}`), measured = at(`measured|${kind}`), names = at("point_names");
      const end = (name) => this.figure.columns[`${name}|${colour}|${kind}|${model}`];
      const value = { predicted: (n) => predicted[n], measured: (n) => measured[n],
        ratio: (n) => (predicted[n] === null || measured[n] === null ? null : measured[n] / predicted[n]) }[colour];
      const shades = names.map((_, n) => {
        const known = value(n);
        return known === null || known <= 0 ? end("low") : Math.min(Math.max(Math.log10(known), end("known_from")), end("high"));
      });
      const mm = (number) => (number === null ? "unknown" : `${Number(number.toPrecision(3))} mm`);
      for (const trace of traces) {
        if (trace.meta && trace.meta.shaded) trace.intensity = shades.flatMap((shade) => [shade, shade]);
        if (!trace.meta || !trace.meta.pick) continue;
        // The scale of ratios is dark at both ends: a ring says that the ratio is below 1.
        const below = (n) => colour === "ratio" && measured[n] !== null && measured[n] < predicted[n];
        const sign = (sigma, n) => (sigma === null ? "x" : below(n) ? "circle-open" : "circle");
        trace.marker = { ...trace.marker, symbol: predicted.map(sign) };
        trace.text = names.map((name, n) => `marker ${name}\npredicted ${mm(predicted[n])}, measured ${mm(measured[n])}`);
      }
    }
    lines(at, centre, markers, width, colour) {
      const places = at("camera_places"), should = at("should_see"), axes = [[], [], []];
      places.forEach((place, c) => markers.forEach((n) => {
        if (should[c][n] === "1") axes.forEach((values, k) => values.push(place[k], centre(n)[k], null));
      }));
      return { type: "scatter3d", mode: "lines", x: axes[0], y: axes[1], z: axes[2], hoverinfo: "skip", showlegend: false,
        line: { color: colour, width } };
    }
  }

  /** Root is the lower Cholesky factor in mm: xx, yx, yy, zx, zy, zz. */
  function ellipsoid(centre, root, times) {
    const [a, b, c, d, e, f] = root.map((value) => (value * ELLIPSOID * times) / 1000);
    const across = 24, up = 12, mesh = { x: [], y: [], z: [], i: [], j: [], k: [] };
    for (let v = 0; v <= up; v++) for (let u = 0; u < across; u++) {
      const polar = (Math.PI * v) / up, around = (2 * Math.PI * u) / across;
      const p = Math.sin(polar) * Math.cos(around), q = Math.sin(polar) * Math.sin(around), r = Math.cos(polar);
      mesh.x.push(centre[0] + a * p);
      mesh.y.push(centre[1] + b * p + c * q);
      mesh.z.push(centre[2] + d * p + e * q + f * r);
      if (v < up) {
        const here = v * across + u, next = v * across + ((u + 1) % across);
        mesh.i.push(here, next); mesh.j.push(next, next + across); mesh.k.push(here + across, here + across);
      }
    }
    return { type: "mesh3d", ...mesh, color: "#d6408f", opacity: 1, hoverinfo: "skip", flatshading: false,
      lighting: { ambient: 0.6, diffuse: 0.6 } };
  }

  // ---- pictures ---------------------------------------------------------------------------------------------------

  class Pictures {
    constructor(sweep) {
      this.sweep = sweep;
      this.root = sweep.section.querySelector("[data-images]");
      this.camera = this.root.querySelector("[data-camera]");
      this.root.querySelectorAll("select, input").forEach((input) => input.addEventListener("change", () => this.stale()));
      this.root.owner = this;
      this.dirty = true;
      watcher.observe(this.root);
    }
    stale() { this.dirty = true; if (this.seen) this.refresh(); }
    refresh() {
      if (!this.dirty) return;
      this.dirty = false;
      const { data: run, step } = this.sweep, views = run.views[step], names = views.map(([name]) => name);
      const had = this.camera.value, first = this.camera.options.length === 0;
      if ([...this.camera.options].map((o) => o.value).join() !== [ALL_CAMERAS, ...names].join())
        this.camera.replaceChildren(new Option("all", ALL_CAMERAS), ...names.map((name) => new Option(name, name)));
      const changing = names.find((_, n) => run.views.some((of) => !of[n] || of[n][1] !== views[n][1]));
      const fallback = first && this.root.dataset.images === "all" ? ALL_CAMERAS : changing || names[0];
      this.camera.value = names.includes(had) || had === ALL_CAMERAS ? had : fallback;
      const shown = this.camera.value === ALL_CAMERAS ? views : views.filter(([name]) => name === this.camera.value);
      const holder = this.root.querySelector(".stages");
      while (holder.children.length > shown.length) holder.lastElementChild.remove();
      while (holder.children.length < shown.length) holder.append(holder.firstElementChild.cloneNode(true));
      holder.classList.toggle("many", shown.length > 1);
      const layer = this.root.querySelector("[data-picture]:checked").value;
      this.root.querySelectorAll("[data-scale]").forEach((scale) => { scale.hidden = scale.dataset.scale !== layer; });
      const words = shown.map((view, n) => this.fill(holder.children[n], view, layer));
      this.root.querySelector("[data-view-description]").textContent = shown.length > 1 ? `All cameras${this.sweep.where}.` : words[0];
    }
    /** One view's picture with what is drawn over it; its description. */
    fill(frame, [name, key, note], layer) {
      const view = data.views[key], stage = frame.querySelector(".stage"), img = frame.querySelector("[data-img]");
      const over = new Set([...this.root.querySelectorAll("[data-over]:checked")].map((box) => box.dataset.over));
      const uri = view.pictures[layer === "error" ? "clean" : layer];
      if (uri) img.src = uri; else img.removeAttribute("src");
      stage.style.aspectRatio = view.size.join(" / ");
      stage.classList.toggle("dim", layer === "error");
      const found = view.markers.filter((m) => m[4] >= 0.5).length, should = view.markers.filter((m) => m[3]).length;
      let words = `${found} markers found, ${should} should be seen.`;
      const times = layer === "error" ? this.enlarged(view) : 0;
      if (times) words += ` Errors are drawn ${times} times as large.`;
      frame.querySelector("[data-of]").textContent = `camera ${name}${note ? ", " + note : ""}: ${words}`;
      const description = `Camera ${name}${this.sweep.where}: ${words}`;
      img.alt = `${description} Picture: ${layer}.`;
      frame.querySelector("[data-svg]").replaceWith(this.overlay(view, over, times));
      return description;
    }
    enlarged(view) {
      const errors = view.markers.filter((m) => m[7] !== null).map((m) => Math.hypot(m[5], m[6], m[7])).sort((a, b) => a - b);
      if (!errors.length) return 1;
      const typical = errors[Math.floor(errors.length * 0.8)], wanted = (ERROR_SHARE * view.size[0]) / typical;
      const power = 10 ** Math.floor(Math.log10(wanted));
      return power * [5, 2, 1].find((digit) => digit * power <= wanted);
    }
    overlay(view, over, times) {
      const make = (name, attributes, parent) => {
        const element = document.createElementNS("http://www.w3.org/2000/svg", name);
        Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
        if (parent) parent.append(element);
        return element;
      };
      const [width, height] = view.size, unit = width / 640;
      const svg = make("svg", { viewBox: `-0.5 -0.5 ${width} ${height}`, "data-svg": "", "aria-hidden": "true" });
      const twice = (name, attributes, colour, stroke) => {
        make(name, { ...attributes, fill: "none", stroke: "#000", "stroke-width": (stroke + 1.8) * unit, "stroke-opacity": 0.75 }, svg);
        make(name, { ...attributes, fill: "none", stroke: colour, "stroke-width": stroke * unit }, svg);
      };
      for (const [id, x, y, should, rate, dx, dy, spread] of view.markers) {
        if (times && rate > 0 && dx !== null) {
          if (spread !== null) twice("circle", { cx: x + dx * times, cy: y + dy * times, r: Math.max(spread * times, unit) }, "#56b4e9", 1.2);
          twice("path", { d: `M${x} ${y}L${x + dx * times} ${y + dy * times}` }, "#ffffff", 1.6);
        }
        if (over.has("detections") && !times) {
          const r = 7 * unit;
          if (rate >= 0.5) twice("circle", { cx: x + (dx || 0), cy: y + (dy || 0), r }, "#7fffd4", 1.8);
          else if (should) twice("path", { d: `M${x - r} ${y - r}L${x + r} ${y + r}M${x - r} ${y + r}L${x + r} ${y - r}` }, "#ffb000", 1.8);
        }
        if (over.has("truth")) twice("path", { d: `M${x - 4 * unit} ${y}H${x + 4 * unit}M${x} ${y - 4 * unit}V${y + 4 * unit}` }, "#ffffff", 1);
        if (over.has("numbers")) {
          const text = make("text", { x: x + 9 * unit, y: y - 5 * unit, "font-size": 11 * unit, fill: "#fff", stroke: "#000",
            "stroke-width": 2.5 * unit, "paint-order": "stroke", "font-family": "sans-serif" }, svg);
          text.textContent = id;
        }
      }
      return svg;
    }
  }

  // ---- the page ---------------------------------------------------------------------------------------------------

  const sweeps = [...document.querySelectorAll("[data-sweep]")].map((section) => new Sweep(section));
  drawForPaper(() => sweeps.flatMap((sweep) => [...sweep.plots, sweep.pictures]));
  document.documentElement.dataset.ready = String(Math.round(performance.now()));
})();
