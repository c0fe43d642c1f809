// Linked viewers of HDR images. A section `.viewer` has figures with the pixels as base64 of half floats, R, G, B, little endian.
// Its panes show one figure each; all panes of the viewers of one group share zoom, place, exposure and mode.
// One section with its images and panes.
class Section {
  constructor(element, group) {
    this.element = element;
    this.group = group;
    this.shots = [...element.querySelectorAll("figure")].map((figure) => new Shot(figure));
    this.reference = this.shots.find((shot) => shot.isReference);
    this.panes = [];
    this.add(0);
    // Where there is room, the reference stands beside the first image.
    if (this.reference && this.shots.length > 1 && innerWidth >= 800) this.add(this.shots.indexOf(this.reference));
    this.active = this.panes[0];
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

  add(index) {
    const pane = new Pane(this, index);
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
    if (what === "add") this.add((this.active.index + 1) % this.shots.length);
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
