// Sources and sinks of power, as a Sankey diagram: what flows in flows out.
import {show} from "./plots.js";

const SVG = "http://www.w3.org/2000/svg";
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999933", "#666666"];
const LEFT = 250, RIGHT = 710, WIDTH = 26, TOP = 24, HEIGHT = 400, GAP = 14;

function shape(name, words) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(words)) element.setAttribute(key, value);
  return element;
}

function text(words, content) {
  const element = shape("text", words);
  element.textContent = content;
  return element;
}

// `latest`: newest values by column. Returns [name, W, colour]; positive brings.
function powers(latest, torques) {
  const all = torques.map((name) => [name, latest[name + "/power"]]);
  all.push(["reactions", latest["power/reactions"]]);
  const known = all.filter(([, value]) => Number.isFinite(value));
  const sum = known.reduce((total, [, value]) => total + value, 0);
  return [...known, ["kinetic energy", -sum]].map(([name, value], i) => [name, value, COLOURS[i % COLOURS.length]]);
}

function side(flows, total, x, anchor) {
  // Bars of one side, from the top; `offset` is where their bands leave the middle.
  const height = (HEIGHT - GAP * Math.max(0, flows.length - 1)) / total;
  let y = TOP, offset = TOP;
  const middle = HEIGHT / total;
  return flows.map(([name, value, colour]) => {
    const bar = {name, value, colour, x, anchor, y, size: Math.abs(value) * height, middle: offset,
      middleSize: Math.abs(value) * middle};
    y += bar.size + GAP;
    offset += bar.middleSize;
    return bar;
  });
}

function band(bar, from, to) {
  const centre = (from + to) / 2;
  const curve = (a, b, x0, x1) => `C${centre},${a} ${centre},${b} ${x1},${b}`;
  return shape("path", {fill: bar.colour, "fill-opacity": 0.35,
    d: `M${from},${bar.y} ${curve(bar.y, bar.middle, from, to)} V${bar.middle + bar.middleSize} ` +
       `${curve(bar.middle + bar.middleSize, bar.y + bar.size, to, from)} Z`});
}

export function drawFlow(svg, table, latest, torques) {
  const all = powers(latest, torques);
  const greatest = Math.max(...all.map(([, value]) => Math.abs(value)), 0);
  const shown = all.filter(([, value]) => Math.abs(value) > Math.max(1e-3 * greatest, 1e-9));
  const brings = shown.filter(([, value]) => value > 0);
  const takes = shown.filter(([, value]) => value < 0);
  const total = brings.reduce((sum, [, value]) => sum + value, 0);
  const parts = [];
  if (!(total > 0)) {
    parts.push(text({x: 480, y: 220, "text-anchor": "middle"}, "no power flows"));
  } else {
    const taken = -takes.reduce((sum, [, value]) => sum + value, 0);
    const middle = 480 - WIDTH / 2;
    const bars = [...side(brings, total, LEFT, "end"), ...side(takes, Math.max(taken, 1e-12), RIGHT, "start")];
    for (const bar of bars) {
      const left = bar.anchor === "end";
      parts.push(left ? band(bar, bar.x + WIDTH, middle) : band(bar, bar.x, middle + WIDTH));
      parts.push(shape("rect", {x: bar.x, y: bar.y, width: WIDTH, height: Math.max(bar.size, 1), fill: bar.colour}));
      const x = left ? bar.x - 10 : bar.x + WIDTH + 10;
      const y = bar.y + bar.size / 2;
      parts.push(text({x, y: y - 2, "text-anchor": bar.anchor}, bar.name));
      parts.push(text({x, y: y + 14, "text-anchor": bar.anchor, class: "watt"}, show(Math.abs(bar.value)) + " W"));
    }
    parts.push(shape("rect", {x: middle, y: TOP, width: WIDTH, height: HEIGHT, fill: "#22303d"}));
    parts.push(text({x: 480, y: TOP + HEIGHT + 22, "text-anchor": "middle"}, `${show(total)} W`));
  }
  svg.replaceChildren(...parts);
  const rows = [["kinetic energy, J", latest["energy/kinetic"]],
    ["brought by the applied torques since the start, J", latest["energy/applied"]],
    ["brought by the reactions of the constraints since the start, J", latest["energy/reactions"]]];
  table.replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement("tr");
    row.insertCell().textContent = name;
    row.insertCell().textContent = show(value);
    return row;
  }));
}
