// The page: one WebSocket, a frame at a time. The next is asked for when the last one is drawn.
import {Board} from "./plots.js";
import {Controls, isGoing} from "./controls.js";
import {drawFlow} from "./energy.js";
import {saveData, savePicture} from "./save.js";

const $ = (id) => document.getElementById(id);
let socket = null;
let scene = null;
let node = "";
let view = "plots";
let held = null;    // the range that is looked at while new frames are not drawn
let newest = null;  // s
let frames = 0;

function send(words) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(words));
}

const seconds = () => Number($("seconds").value);
// It fills from the left, then it scrolls.
const range = () => {
  if (held) return held;
  const begin = Math.max(0, newest - seconds());
  return [begin, begin + seconds()];
};
const controls = new Controls(send);
const board = new Board($("plots"), $("add"), ask, hold);

// Shows this range and no newer frames; null: goes on.
function hold(window) {
  if (held && !window) board.resetZoom();
  held = window;
  $("hold").checked = window !== null;
  ask();
}

// The content that the page shows now; the rest is not requested.
function ask() {
  if (!scene) return;
  const flow = view === "energy"
    ? [...scene.torques.map((name) => name + "/power"), "power/reactions", "energy/kinetic", "energy/applied", "energy/reactions"]
    : [];
  send({show: {columns: view === "plots" ? board.wanted() : [], latest: [...controls.wanted(), ...flow],
    seconds: held ? held[1] - held[0] : seconds(), end: held ? held[1] : null}});
}

function setScene(words) {
  node = words.node;
  controls.setScene(words);
  scene = words.scene;
  if (!scene) return;
  board.setColumns(node + " " + scene.shafts + " " + scene.constraints, words.columns);
  $("about").textContent = `Principle: ${scene.principle}. Stepper: ${scene.stepper}.`;
  showEquations(words.explanation);
  $("parameters").textContent = scene.parameters;
  ask();
}

// The names of the program in the letters of the theory; headings stand at the margin.
function showEquations(text) {
  const letters = [[/\bphi(?=_|\d|\b)/g, "φ"], [/\bpsi\b/g, "ψ"], [/\bw(?=_|\d|,)/g, "ω"], [/\be(?=_|\d|,|:)/g, "ε"],
    [/\bj(?=_|\d|:)/g, "η"], [/\bLambda/g, "Λ"], [/\blambda/g, "λ"], [/\^T/g, "ᵀ"], [/\^2\b/g, "²"], [/\^3\b/g, "³"], [/\*/g, "·"]];
  $("equations").replaceChildren();
  for (const line of text.split("\n")) {
    let words = line;
    for (const [name, letter] of letters) words = words.replace(name, letter);
    const moved = line.indexOf(" = ") - words.indexOf(" = ");
    if (moved > 0) words = words.replace(" = ", " ".repeat(moved) + " = ");
    const part = document.createElement(/^\S/.test(line) ? "b" : "span");
    part.textContent = words + "\n";
    $("equations").append(part);
  }
}

// The node publishes powers while they are looked at and time goes on; what came before may be old.
function tellFlowTime(frame) {
  const times = [frame.latest_times.elements, frame.latest_times.energy].filter(Number.isFinite);
  const [first, last] = [Math.min(...times), Math.max(...times)].map((time) => time.toFixed(3) + " s");
  $("flow-time").textContent = !times.length ? "–" : first === last ? last : `${first} and ${last}`;
  const {status} = frame;
  const stands = !frame.alive || (status && !isGoing(status));
  const isOld = stands && status && times.length && status.time - Math.min(...times) > 1e-6;
  $("flow-old").textContent = isOld ? `Not the state of now, ${status.time.toFixed(3)} s: the simulation stands, and its powers come again ` +
    "when it is stepped, resumed or reset." : "";
}

function take(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const frame = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  if (!held) newest = frame.newest;
  controls.tell(frame);
  $("nothing").hidden = view !== "plots" || newest !== null;
  if (view === "energy" && scene) {
    tellFlowTime(frame);
    drawFlow($("flow"), $("account"), frame.latest, scene.torques);
  }
  if (frame.rows === undefined || view !== "plots") return;
  const column = (i) => new Float64Array(buffer, 4 + size + 8 * i * frame.rows, frame.rows);
  const series = new Map(frame.columns.map((name, i) => [name, column(i + 1)]));
  if (held || newest !== null) board.draw(column(0), series, range(), !held);
  frames += 1;
  document.body.dataset.frames = frames;
}

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { ask(); send({pull: 1}); };
  socket.onmessage = (event) => {
    if (typeof event.data !== "string") {
      take(event.data);
      // A hidden page draws nothing and asks for nothing.
      return requestAnimationFrame(() => send({pull: 1}));
    }
    const words = JSON.parse(event.data);
    if (words.kind === "scene") setScene(words);
    if (words.kind === "answer" && words.text) controls.answer(words);
  };
  socket.onclose = () => {
    controls.disconnected();
    setTimeout(connect, 1000);
  };
}

for (const tab of document.querySelectorAll(".tab")) {
  tab.onclick = () => {
    view = tab.dataset.view;
    for (const other of document.querySelectorAll(".tab")) other.classList.toggle("chosen", other === tab);
    for (const id of ["plots", "energy", "scene"]) $(id).hidden = id !== view;
    $("tools").hidden = view !== "plots";
    ask();
  };
}
$("seconds").onchange = () => hold(null);
$("hold").onchange = () => hold($("hold").checked ? range() : null);
$("save-png").onclick = () => savePicture(node, $("plots"));
$("save-csv").onclick = () => saveData("csv", node, board.wanted(), range());
$("save-bag").onclick = () => saveData("bag", node, board.wanted(), range());
connect();
