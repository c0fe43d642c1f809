// One view of one image: drawing, zoom, pan and the values under the pointer.
const MAX_ZOOM = 256;

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
