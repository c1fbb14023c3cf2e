// Sources and sinks of power, as a Sankey diagram: what flows in flows out.
import {show} from "./plots.js";

const SVG = "http://www.w3.org/2000/svg";
const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999933", "#666666"];
const LEFT = 250, RIGHT = 710, WIDTH = 26, TOP = 24, HEIGHT = 400, GAP = 14;
const MOST = 9;      // bars of one side
const LABEL = 32;    // height of a label of two lines
const LONGEST = 30;  // letters of a name that fit beside a bar

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

// The greatest of one side, the others as one.
function gather(flows) {
  if (flows.length <= MOST) return flows;
  const order = [...flows].sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]));
  const kept = new Set(order.slice(0, MOST - 1));
  const rest = order.slice(MOST - 1);
  return [...flows.filter((flow) => kept.has(flow)),
    [`${rest.length} others`, rest.reduce((sum, [, value]) => sum + value, 0), "#9aa5b0"]];
}

// Places the bars of one side from the top, each in the middle of a place that has room for its label; `middle` is
// where its band leaves the bar between both sides.
function side(flows, total, x, anchor) {
  const place = (value, scale) => Math.max(Math.abs(value) * scale + GAP, LABEL);
  const room = (scale) => flows.reduce((sum, [, value]) => sum + place(value, scale), 0);
  let scale = HEIGHT / total;
  for (let i = 0, step = scale / 2; i < 30; ++i, step /= 2) scale += room(scale) > HEIGHT + GAP ? -step : step;
  scale = Math.min(scale, HEIGHT / total);
  let y = TOP - GAP / 2, offset = TOP;
  return flows.map(([name, value, colour]) => {
    const size = Math.abs(value) * scale, middleSize = Math.abs(value) * HEIGHT / total;
    const bar = {name, value, colour, x, anchor, y: y + (place(value, scale) - size) / 2, size, middle: offset, middleSize};
    y += place(value, scale);
    offset += middleSize;
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
    parts.push(text({x: 480, y: 220, "text-anchor": "middle"}, all.length > 1 ? "no power flows" : "nothing has come yet"));
  } else {
    const taken = -takes.reduce((sum, [, value]) => sum + value, 0);
    const middle = 480 - WIDTH / 2;
    const bars = [...side(gather(brings), total, LEFT, "end"), ...side(gather(takes), Math.max(taken, 1e-12), RIGHT, "start")];
    for (const bar of bars) {
      const left = bar.anchor === "end";
      parts.push(left ? band(bar, bar.x + WIDTH, middle) : band(bar, bar.x, middle + WIDTH));
      parts.push(shape("rect", {x: bar.x, y: bar.y, width: WIDTH, height: Math.max(bar.size, 1), fill: bar.colour}));
      const x = left ? bar.x - 10 : bar.x + WIDTH + 10;
      const y = bar.y + bar.size / 2;
      const name = bar.name.length > LONGEST ? bar.name.slice(0, LONGEST - 1) + "…" : bar.name;
      parts.push(text({x, y: y - 2, "text-anchor": bar.anchor}, name));
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
