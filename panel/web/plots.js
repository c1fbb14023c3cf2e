// Plots of one quantity each, all over the same window of simulated time.

// Wong's palette: told apart by colour-blind readers too.
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#999933"];
const WORDS = {angle: "Angle", velocity: "Speed", acceleration: "Acceleration", applied_torque: "Applied torque",
  reaction_torque: "Reaction torque", reaction_torque_rate: "Reaction torque rate", residual: "Residual",
  multiplier: "Multiplier", "element torque": "Element torques", "element power": "Element powers",
  "element output": "Element outputs", "element slip": "Slips", "element reserve": "Reserves", "element heat": "Heat", mode: "Modes", inputs: "Inputs", outputs: "Outputs", energy: "Energy", power: "Power"};
// Modes of elements that hold: word, colour of the band, colour of its text.
const MODES = new Map([[0, ["stuck", "#0072B2", "#fff"]], [1, ["forward", "#E69F00", "#000"]], [-1, ["backward", "#CC79A7", "#000"]],
  [2, ["free", "#dde2e7", "#000"]]]);
const BAND = 14;  // px
const MOST_CHIPS = 9;   // names above a plot: more would leave no room for the curves
const FIRST = ["velocity", "applied_torque", "acceleration", "reaction_torque"];
const FLAT = 1e-6;  // in the unit of the quantity
// Quantities whose columns have units of their own: one column a plot, at first.
const SINGLE = new Set(["inputs", "outputs", "element output", "residual", "multiplier"]);

export function make(tag, words = {}, ...children) {
  const element = document.createElement(tag);
  Object.assign(element, words);
  element.append(...children);
  return element;
}

// A short number of steady width for what changes all the time.
export function show(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size === 0) return "0";
  if ((size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return value.toFixed(size >= 1000 ? 1 : size >= 10 ? 2 : size >= 1 ? 3 : 4);
}

class Plot {
  constructor(board, names) {
    this.board = board;
    this.names = names;
    this.element = make("div", {className: "plot"});
    this.observer = new ResizeObserver(() => this.graph?.resize());
    this.observer.observe(this.element);
    this.build();
  }

  close() {
    this.observer.disconnect();
    this.graph?.destroy();
    this.graph = null;
    this.element.remove();
  }

  columns() {
    return this.names.map((name) => this.board.columns.get(name)).filter(Boolean);
  }

  build() {
    const columns = this.columns();
    const first = columns[0];
    const same = columns.every((column) => column.quantity === first.quantity);
    const single = same && SINGLE.has(first?.quantity) && columns.length === 1;
    this.title = !first ? "nothing" : single ? first.name : WORDS[first.quantity] ?? first.quantity;
    this.unit = first?.unit ?? "";
    const title = make("h3", {}, this.title, make("small", {}, this.unit ? `, ${this.unit}` : ""));
    this.count = columns.length;
    this.chips = columns.slice(0, MOST_CHIPS).map((column, i) => {
      const chip = make("span", {className: "chip"}, make("i"), this.brief(column), make("output"));
      chip.firstChild.style.background = COLOURS[i % COLOURS.length];
      return chip;
    });
    const pick = make("button", {textContent: "columns", title: "Choose the columns"});
    pick.onclick = () => this.togglePicker();
    const close = make("button", {textContent: "✕", title: "Close this plot"});
    close.onclick = () => this.board.remove(this);
    const more = columns.slice(MOST_CHIPS);
    const rest = more.length ? [make("small", {title: more.map((column) => this.brief(column)).join("\n")}, `and ${more.length} more`)] : [];
    this.head = make("div", {className: "head"}, make("div", {className: "legend"}, title, ...this.chips, ...rest),
      make("div", {className: "tools"}, pick, close));
    this.canvas = make("div");
    this.element.replaceChildren(this.head, make("div", {className: "curve"}, this.canvas));
    this.graph?.destroy();
    this.graph = null;
    this.marked = false;
  }

  brief(column) {
    return SINGLE.has(column.quantity) ? column.name.replace(/^(inputs|outputs)\//, "")
      : column.name.replace(/\/[^/]*$/, "");
  }

  togglePicker() {
    if (this.picker?.isConnected) return this.picker.remove();
    const unit = this.columns()[0];
    this.picker = make("div", {className: "picker"});
    for (const column of this.board.columns.values()) {
      // One axis, one unit; columns of an own unit only beside others of their kind.
      if (unit && (column.unit !== unit.unit || (!unit.unit && column.quantity !== unit.quantity))) continue;
      const box = make("input", {type: "checkbox", checked: this.names.includes(column.name)});
      box.onchange = () => {
        this.names = box.checked ? [...this.names, column.name] : this.names.filter((name) => name !== column.name);
        if (!this.names.length) return this.board.remove(this);
        const picker = this.picker;
        this.build();
        this.element.append(picker);
        this.board.changed();
      };
      this.picker.append(make("label", {}, box, " " + column.name));
    }
    this.element.append(this.picker);
  }

  // The first curve is the widest: one that runs under another is still seen.
  widths() {
    const columns = this.columns();
    return Object.fromEntries(columns.map((column, i) => [column.name, {strokeWidth: 1.4 + 2 * (1 - (i + 1) / columns.length)}]));
  }

  // The modes of elements that hold, as bands along the lower edge.
  drawBands(context, area, graph) {
    const {times, modes} = this.bands;
    context.save();
    context.font = "10px sans-serif";
    context.textBaseline = "middle";
    modes.forEach(([name, values], row) => {
      const y = area.y + area.h - BAND * (modes.length - row);
      // The name stands behind the band, or, where that reaches the edge, in its parts.
      const behind = times.length ? graph.toDomXCoord(times[times.length - 1]) + 4 : area.x;
      context.fillStyle = "#000";
      if (behind + context.measureText(name).width < area.x + area.w) context.fillText(name, behind, y + BAND / 2 - 1);
      for (let i = 0, end; i < times.length; i = end) {
        for (end = i + 1; end < times.length && values[end] === values[i]; ++end);
        const look = MODES.get(values[i]);
        if (!look) continue;
        const left = Math.max(area.x, graph.toDomXCoord(times[i]));
        const right = Math.min(area.x + area.w, graph.toDomXCoord(times[Math.min(end, times.length - 1)]));
        if (right <= left) continue;
        context.fillStyle = look[1];
        context.fillRect(left, y, right - left, BAND - 2);
        const words = [`${name}: ${look[0]}`, look[0]].find((text) => context.measureText(text).width + 8 < right - left);
        context.fillStyle = look[2];
        if (words) context.fillText(words, left + 4, y + BAND / 2 - 1);
      }
    });
    context.restore();
  }

  // `series`: name to Float64Array; `range`: [begin, end] in s; `free`: not zoomed by the user.
  draw(times, series, range, free) {
    const curves = this.columns().map((column) => series.get(column.name));
    if (!curves.length) return;
    const modes = this.board.modes(this).map((name) => [name.replace(/\/mode$/, ""), series.get(name)]).filter(([, values]) => values);
    this.bands = {times, modes};
    const rows = new Array(times.length);
    let least = Infinity, greatest = -Infinity;
    for (let i = 0; i < times.length; ++i) {
      const row = [times[i]];
      for (const curve of curves) {
        const value = curve && Number.isFinite(curve[i]) ? curve[i] : null;
        row.push(value);
        if (value < least) least = value;
        if (value > greatest) greatest = value;
      }
      rows[i] = row;
    }
    // Values that are zero but for rounding are drawn as zero.
    const flat = greatest - least < FLAT && Math.abs(greatest) < FLAT && !this.names.some((name) => name.endsWith("/residual"));
    const valueRange = flat ? [-1, 1] : null;
    this.last = rows[rows.length - 1];
    if (!rows.length) rows.push([range[1], ...curves.map(() => null)]);
    if (this.graph) {
      this.graph.updateOptions({file: rows, dateWindow: range, yRangePad: 8 + BAND * modes.length, ...(free && {axes: {y: {valueRange}}})});
    } else {
      this.graph = new Dygraph(this.canvas, rows, {
        labels: ["time", ...this.columns().map((column) => column.name)], colors: COLOURS.slice(0, Math.max(1, curves.length)),
        dateWindow: range, legend: "never", series: this.widths(), gridLineColor: "#e6eaee", axisLineColor: "#b9c3cd",
        gridLineWidth: 1, highlightCircleSize: 3, animatedZooms: false,
        includeZero: false, yRangePad: 8 + BAND * modes.length, underlayCallback: (...canvas) => this.drawBands(...canvas),
        axes: {y: {valueRange, axisLabelWidth: 58, pixelsPerLabel: 32, axisLabelFormatter: tick},
          x: {pixelsPerLabel: 60, axisLabelFormatter: tick}},
        highlightCallback: (event, x, points, row) => this.mark(row),
        unhighlightCallback: () => this.mark(null),
        zoomCallback: (begin, end) => this.board.zoomed([begin, end]),
      });
      // After the library's own: all of the window, and on.
      this.canvas.addEventListener("dblclick", () => setTimeout(() => this.board.zoomed(null)));
    }
    if (!this.marked) this.tell(this.last);
  }

  mark(row) {
    this.marked = row !== null;
    if (!this.marked) return this.tell(this.last);
    this.tell(this.columns().map((_, i) => this.graph.getValue(row, i + 1)), 0);
  }

  tell(row, first = 1) {
    this.chips.forEach((chip, i) => { chip.lastChild.value = show(row?.[i + first]); });
  }
}

// A number as one would write it.
export function tick(value) {
  const size = Math.abs(value);
  if (size >= 1e5 || (size !== 0 && size < 1e-4)) return value.toExponential(1);
  return String(Number(value.toPrecision(7)));
}

// All plots; `changed` is called when other columns are wanted, `zoomed` when the user zooms.
export class Board {
  constructor(element, chooser, changed, zoomed) {
    Object.assign(this, {element, chooser, changed: () => { this.remember(); changed(); }, zoomed});
    this.columns = new Map();
    this.plots = [];
    chooser.onchange = () => {
      this.add(chooser.value.startsWith("column:") ? [chooser.value.slice(7)] : this.family(chooser.value));
      chooser.selectedIndex = 0;
      this.changed();
    };
  }

  family(quantity) {
    return [...this.columns.values()].filter((column) => column.quantity === quantity).map((column) => column.name);
  }

  // A scene, or more of its columns.
  setColumns(key, columns) {
    this.columns = new Map(columns.map((column) => [column.name, column]));
    const options = [make("option", {textContent: "add a plot"})];
    for (const quantity of new Set(columns.map((column) => column.quantity))) {
      if (SINGLE.has(quantity)) {
        options.push(...this.family(quantity).map((name) => make("option", {value: "column:" + name, textContent: name})));
      } else {
        options.push(make("option", {value: quantity, textContent: WORDS[quantity] ?? quantity}));
      }
    }
    this.chooser.replaceChildren(...options);
    if (this.key === key) return this.plots.forEach((plot) => plot.columns().length !== plot.count && plot.build());
    this.key = key;
    this.plots.forEach((plot) => plot.close());
    this.plots = [];
    let kept = null;
    try { kept = JSON.parse(localStorage.getItem("plots of " + key)); } catch { /* as if never seen */ }
    for (const names of kept ?? FIRST.map((quantity) => this.family(quantity))) if (names.length) this.add(names);
  }

  remember() {
    try { localStorage.setItem("plots of " + this.key, JSON.stringify(this.plots.map((plot) => plot.names))); } catch { /* private window */ }
  }

  add(names) {
    const plot = new Plot(this, names);
    this.plots.push(plot);
    this.element.append(plot.element);
  }

  remove(plot) {
    this.plots = this.plots.filter((other) => other !== plot);
    plot.close();
    this.changed();
  }

  wanted() {
    return [...new Set(this.plots.flatMap((plot) => [...plot.names, ...this.modes(plot)]))];
  }

  // Columns that are drawn as bands under the curves of a plot: under speeds the modes of elements, as many as leave room.
  modes(plot) {
    return plot.columns()[0]?.quantity === "velocity" ? this.family("mode").slice(0, 6) : [];
  }

  resetZoom() {
    for (const plot of this.plots) plot.graph?.updateOptions({valueRange: null, axes: {y: {valueRange: null}}}, true);
  }

  draw(...frame) {
    for (const plot of this.plots) plot.draw(...frame);
  }
}
