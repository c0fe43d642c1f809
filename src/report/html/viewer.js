// Linked viewers of HDR images. A section `.viewer` has figures with the pixels as base64 of half floats, R, G, B, little endian.
// Its panes show one figure each; all panes of the viewers of one group share zoom, place, exposure and mode.
"use strict";
(() => {
  const HALVES = 65536;
  const MAX_ZOOM = 256;
  // Added to the squared reference, as in relMSE, and to the reference of the signed difference.
  const EPSILON = 0.01;
  // Anchors of the colour map magma, from low to high.
  const MAGMA = [[0, 0, 4], [59, 15, 112], [140, 41, 129], [222, 73, 104], [254, 159, 109], [252, 253, 191]];
  // Colours of a pixel that is darker or brighter than the reference.
  const DARKER = [70, 150, 255];
  const BRIGHTER = [255, 140, 30];

  const floatOfHalf = new Float32Array(HALVES);
  for (let bits = 0; bits < HALVES; bits++) {
    const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
    const sign = bits & 0x8000 ? -1 : 1;
    if (exponent === 31) floatOfHalf[bits] = fraction ? NaN : sign * Infinity;
    else if (exponent === 0) floatOfHalf[bits] = sign * fraction * 2 ** -24;
    else floatOfHalf[bits] = sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
  }

  const luminance = (r, g, b) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

  // sRGB code of every half float at this exposure. What is no number is black.
  function displayCodes(stops) {
    const codes = new Uint8Array(HALVES);
    const gain = 2 ** stops;
    for (let bits = 0; bits < HALVES; bits++) {
      const v = floatOfHalf[bits] * gain;
      if (v > 0) codes[bits] = Math.round(255 * (v >= 1 ? 1 : v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
    }
    return codes;
  }

  // Entry of the colour map for 0 to 1.
  const magma = Array.from({ length: 256 }, (_, i) => {
    const at = (i / 255) * (MAGMA.length - 1);
    const low = Math.min(Math.floor(at), MAGMA.length - 2);
    return MAGMA[low].map((v, c) => Math.round(v + (at - low) * (MAGMA[low + 1][c] - v)));
  });
  const magmaAt = (t) => magma[t >= 0 ? Math.min(255, Math.round(255 * t)) : 0];

  // One image of a section. Its pixels are decoded when they are first asked for.
  class Shot {
    constructor(figure) {
      const { name, key, width, height, left, top } = figure.dataset;
      Object.assign(this, { figure, name, key, width: +width, height: +height, left: +left, top: +top });
      this.isReference = "reference" in figure.dataset;
    }

    get halves() {
      if (!this.decoded) {
        const bytes = atob(this.figure.querySelector("script").textContent.trim());
        this.decoded = new Uint16Array(bytes.length / 2);
        for (let i = 0; i < this.decoded.length; i++) {
          this.decoded[i] = bytes.charCodeAt(2 * i) | (bytes.charCodeAt(2 * i + 1) << 8);
        }
      }
      return this.decoded;
    }

    at(x, y) {
      const i = 3 * (y * this.width + x);
      return [0, 1, 2].map((c) => floatOfHalf[this.halves[i + c]]);
    }
  }

  const signedDifference = (a, b) => (a - b) / (Math.abs(b) + EPSILON);
  const squaredError = (a, b) => a.reduce((sum, v, c) => sum + (v - b[c]) ** 2 / (b[c] ** 2 + EPSILON), 0) / 3;

  // Colours of all pixels of an image in the state's mode, as RGBA.
  function paint(shot, reference, state) {
    const out = new Uint8ClampedArray(4 * shot.width * shot.height).fill(255);
    const comparable = reference && reference.width === shot.width && reference.height === shot.height;
    const colour = state.difference && comparable ? differenceColour(shot, reference, state) : plainColour(shot, state);
    for (let i = 0, o = 0; o < out.length; i += 3, o += 4) {
      const [r, g, b] = colour(i);
      out[o] = r;
      out[o + 1] = g;
      out[o + 2] = b;
    }
    return new ImageData(out, shot.width, shot.height);
  }

  function plainColour(shot, state) {
    const halves = shot.halves;
    if (state.falseColour) {
      const value = (i) => luminance(floatOfHalf[halves[i]], floatOfHalf[halves[i + 1]], floatOfHalf[halves[i + 2]]);
      return (i) => magmaAt((Math.log2(value(i)) + state.stops + 8) / 12);
    }
    const codes = displayCodes(state.stops);
    return (i) => [codes[halves[i]], codes[halves[i + 1]], codes[halves[i + 2]]];
  }

  function differenceColour(shot, reference, state) {
    const gain = 2 ** state.stops;
    const rgb = (halves, i) => [floatOfHalf[halves[i]], floatOfHalf[halves[i + 1]], floatOfHalf[halves[i + 2]]];
    const [a, b] = [shot.halves, reference.halves];
    if (state.falseColour) {
      return (i) => magmaAt((Math.log10(squaredError(rgb(a, i), rgb(b, i)) * gain) + 5) / 6);
    }
    return (i) => {
      const v = clamp(gain * signedDifference(luminance(...rgb(a, i)), luminance(...rgb(b, i))), -1, 1) || 0;
      return (v < 0 ? DARKER : BRIGHTER).map((c) => c * Math.abs(v));
    };
  }

  const digits = (v) => (Number.isFinite(v) ? v.toPrecision(4) : String(v));
  const triple = (values) => values.map((v) => digits(v).padStart(10)).join("");

  // One canvas that shows one image of its section.
  class Pane {
    constructor(section, index) {
      this.section = section;
      this.index = index;
      this.element = document.createElement("div");
      this.element.className = "pane";
      this.select = document.createElement("select");
      this.select.setAttribute("aria-label", "Image");
      section.shots.forEach((shot, i) => this.select.add(new Option(shot.key ? `${shot.key}  ${shot.name}` : shot.name, i)));
      this.select.addEventListener("change", () => this.show(+this.select.value));
      this.canvas = document.createElement("canvas");
      this.canvas.tabIndex = 0;
      this.values = document.createElement("output");
      this.values.className = "values";
      this.element.append(this.select, this.canvas, this.values);
      this.bitmap = document.createElement("canvas");
      this.listen();
      new ResizeObserver(() => this.draw()).observe(this.canvas);
    }

    get shot() { return this.section.shots[this.index]; }

    show(index) {
      const count = this.section.shots.length;
      this.index = (index + count) % count;
      this.section.active = this;
      this.section.group.redraw();
    }

    listen() {
      const { canvas, section } = this;
      const group = section.group;
      const activate = () => { section.active = this; };
      this.element.addEventListener("pointerenter", activate);
      this.element.addEventListener("focusin", activate);
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        this.zoomAt(event, Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.002)));
      }, { passive: false });
      canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        this.grip = [event.clientX, event.clientY];
      });
      canvas.addEventListener("pointermove", (event) => {
        if (this.grip) this.pan(event);
        group.point(this.pixelAt(event));
      });
      for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { this.grip = null; });
      canvas.addEventListener("pointerleave", () => group.point(null));
    }

    // Size of an image pixel and the place of the image's corner, in CSS pixels of the canvas.
    frame() {
      const { width, height } = this.canvas.getBoundingClientRect();
      const { state } = this.section.group;
      const scale = state.zoom * Math.min(width / this.shot.width, height / this.shot.height);
      const left = width / 2 - state.x * this.shot.width * scale;
      const top = height / 2 - state.y * this.shot.height * scale;
      return { scale, left, top, width, height };
    }

    // The place under the pointer as shares of the image's width and height.
    placeAt(event) {
      const box = this.canvas.getBoundingClientRect();
      const { scale, left, top } = this.frame();
      return [
        (event.clientX - box.left - left) / (scale * this.shot.width),
        (event.clientY - box.top - top) / (scale * this.shot.height),
      ];
    }

    pixelAt(event) {
      const [x, y] = this.placeAt(event);
      return x >= 0 && x < 1 && y >= 0 && y < 1 ? [x, y] : null;
    }

    zoomAt(event, factor) {
      const group = this.section.group;
      const before = this.placeAt(event);
      group.state.zoom = clamp(group.state.zoom * factor, 0.25, MAX_ZOOM);
      const after = this.placeAt(event);
      group.state.x += before[0] - after[0];
      group.state.y += before[1] - after[1];
      group.redraw();
    }

    pan(event) {
      const { scale } = this.frame();
      const { state } = this.section.group;
      state.x -= (event.clientX - this.grip[0]) / (scale * this.shot.width);
      state.y -= (event.clientY - this.grip[1]) / (scale * this.shot.height);
      this.grip = [event.clientX, event.clientY];
      this.section.group.redraw();
    }

    // Paints the pixels anew only if image or mode changed.
    update() {
      const { state } = this.section.group;
      const painted = [this.index, state.stops, state.falseColour, state.difference].join();
      if (painted === this.painted) return;
      this.painted = painted;
      [this.bitmap.width, this.bitmap.height] = [this.shot.width, this.shot.height];
      this.bitmap.getContext("2d").putImageData(paint(this.shot, this.section.reference, state), 0, 0);
      this.canvas.style.aspectRatio = `${this.shot.width} / ${this.shot.height}`;
      this.canvas.setAttribute("aria-label", this.shot.name);
      this.select.value = this.index;
    }

    draw() {
      this.update();
      const { scale, left, top, width, height } = this.frame();
      const ratio = devicePixelRatio || 1;
      [this.canvas.width, this.canvas.height] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
      const context = this.canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.imageSmoothingEnabled = scale < 1;
      context.drawImage(this.bitmap, left, top, this.shot.width * scale, this.shot.height * scale);
      this.drawCursor(context, scale, left, top);
      this.tell();
    }

    drawCursor(context, scale, left, top) {
      const { cursor } = this.section.group;
      if (!cursor) return;
      const x = left + Math.floor(cursor[0] * this.shot.width) * scale;
      const y = top + Math.floor(cursor[1] * this.shot.height) * scale;
      const size = Math.max(scale, 5);
      const shift = (scale - size) / 2;
      context.lineWidth = 1;
      context.strokeStyle = "#000";
      context.strokeRect(x + shift - 1.5, y + shift - 1.5, size + 3, size + 3);
      context.strokeStyle = "#fff";
      context.strokeRect(x + shift - 0.5, y + shift - 0.5, size + 1, size + 1);
    }

    // Writes the values of the pixel under the pointer, which may be over another pane.
    tell() {
      const { cursor } = this.section.group;
      const { reference } = this.section;
      if (!cursor) {
        this.values.textContent = "";
        return;
      }
      const [x, y] = [Math.floor(cursor[0] * this.shot.width), Math.floor(cursor[1] * this.shot.height)];
      const own = this.shot.at(x, y);
      const lines = [`pixel ${x + this.shot.left}, ${y + this.shot.top}`, `RGB       ${triple(own)}`];
      if (reference && reference !== this.shot && reference.width === this.shot.width && reference.height === this.shot.height) {
        const truth = reference.at(x, y);
        lines.push(`reference ${triple(truth)}`);
        lines.push(`relative error² ${digits(squaredError(own, truth))}`);
      }
      this.values.textContent = lines.join("\n");
    }
  }

  // A section `.viewer` with its images and panes.
  class Section {
    constructor(element, group) {
      this.element = element;
      this.group = group;
      this.shots = [...element.querySelectorAll("figure")].map((figure) => new Shot(figure));
      this.reference = this.shots.find((shot) => shot.isReference);
      this.panes = [];
      this.add();
      this.shots.forEach((shot, index) => this.link(shot, index));
      for (const button of element.querySelectorAll("[data-do]")) {
        button.addEventListener("click", () => this.act(button.dataset.do));
      }
    }

    link(shot, index) {
      const { figure } = shot;
      figure.tabIndex = 0;
      figure.addEventListener("click", () => this.active.show(index));
      figure.addEventListener("keydown", (event) => event.key === "Enter" && this.active.show(index));
    }

    add() {
      const shown = this.panes.length ? this.panes[this.panes.length - 1].index : -1;
      const pane = new Pane(this, (shown + 1) % this.shots.length);
      this.panes.push(pane);
      this.active = pane;
      this.element.querySelector(".panes").append(pane.element);
    }

    remove() {
      if (this.panes.length === 1) return;
      this.panes.pop().element.remove();
      this.active = this.panes[this.panes.length - 1];
    }

    act(what) {
      if (what === "add") this.add();
      else if (what === "remove") this.remove();
      else this.group.change(what);
      this.group.redraw();
    }

    // Returns whether the key meant something.
    press(key) {
      const commands = { e: "brighter", E: "darker", f: "falseColour", F: "falseColour", d: "difference", D: "difference", r: "reset", R: "reset" };
      const steps = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };
      const index = this.shots.findIndex((shot) => shot.key === key);
      if (index >= 0) this.active.show(index);
      else if (key in steps) this.active.show(this.active.index + steps[key]);
      else if (key in commands) this.act(commands[key]);
      else return false;
      return true;
    }

    // Brings buttons, scale and frames around images in line with the state.
    describe() {
      const { state } = this.group;
      const find = (selector) => this.element.querySelector(selector);
      find(".stops").textContent = `exposure ${state.stops > 0 ? "+" : ""}${state.stops}`;
      find("[data-do=falseColour]").setAttribute("aria-pressed", state.falseColour);
      find("[data-do=difference]").setAttribute("aria-pressed", state.difference);
      find("[data-do=difference]").disabled = !this.reference;
      find("[data-do=remove]").disabled = this.panes.length === 1;
      const shown = new Set(this.panes.map((pane) => pane.shot));
      for (const shot of this.shots) shot.figure.classList.toggle("shown", shown.has(shot));
      this.describeScale(find(".scale"), state);
    }

    describeScale(scale, state) {
      const difference = state.difference && this.reference;
      scale.hidden = !difference && !state.falseColour;
      const gain = 2 ** -state.stops;
      const css = (colour) => `rgb(${colour.join()})`;
      let [low, high, what, colours] = [digits(gain * 2 ** -8), digits(gain * 2 ** 4), "luminance, logarithmic", MAGMA];
      if (difference && state.falseColour) {
        [low, high, what] = [digits(gain * 1e-5), digits(gain * 10), "squared relative error, as in relMSE, logarithmic"];
      } else if (difference) {
        [low, high] = [`−${digits(100 * gain)} %`, `+${digits(100 * gain)} %`];
        [what, colours] = ["luminance less that of the reference", [DARKER, [0, 0, 0], BRIGHTER]];
      }
      for (const [name, text] of Object.entries({ low, high, what })) scale.querySelector(`.${name}`).textContent = text;
      scale.querySelector(".bar").style.background = `linear-gradient(to right, ${colours.map(css).join()})`;
    }
  }

  // Viewers that move together.
  class Group {
    constructor() {
      this.sections = [];
      this.cursor = null;
      this.reset();
    }

    reset() { this.state = { zoom: 1, x: 0.5, y: 0.5, stops: 0, falseColour: false, difference: false }; }

    change(what) {
      const { state } = this;
      if (what === "reset") this.reset();
      else if (what === "brighter") state.stops += 0.5;
      else if (what === "darker") state.stops -= 0.5;
      else state[what] = !state[what];
    }

    point(cursor) {
      this.cursor = cursor;
      this.redraw();
    }

    // Many events within one frame of the screen draw once.
    redraw() {
      if (this.pending) return;
      this.pending = true;
      requestAnimationFrame(() => {
        this.pending = false;
        for (const section of this.sections) {
          section.describe();
          for (const pane of section.panes) pane.draw();
        }
      });
    }
  }

  const groups = new Map();
  const sections = [];
  for (const element of document.querySelectorAll(".viewer")) {
    if (!element.querySelector("figure")) continue;
    const name = element.dataset.group;
    if (!groups.has(name)) groups.set(name, new Group());
    const section = new Section(element, groups.get(name));
    groups.get(name).sections.push(section);
    sections.push(section);
  }
  for (const group of groups.values()) group.redraw();

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea")) return;
    const section = sections.find((s) => s.element.querySelector(".panes").matches(":hover, :focus-within"));
    if (section && section.press(event.key)) event.preventDefault();
  });

  document.addEventListener("show-image", (event) => {
    for (const section of sections) {
      const index = section.shots.findIndex((shot) => shot.name === event.detail);
      if (index < 0) continue;
      section.active.show(index);
      section.element.scrollIntoView({ behavior: "smooth", block: "nearest" });
      return;
    }
  });
})();
