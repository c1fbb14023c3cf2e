// Inputs, buttons, status: what acts on the node and what it says of itself.
import {make, show, tick} from "./plots.js";

const STATES = ["RUNNING", "PAUSED", "SLEEPING", "STOPPED"];
const STATUS = [["steps", "steps"], ["rejected_steps", "rejected steps"], ["jumps", "jumps"], ["ticks", "ticks"],
  ["overruns", "overruns"], ["commands_accepted", "commands"], ["commands_clamped", "clamped"],
  ["commands_refused", "refused"]];
const GOING = ["RUNNING", "SLEEPING"];
export const isGoing = (status) => GOING.includes(STATES[status.state]);
const SENDING = 1000 / 30;  // ms between two commands of one slider

class Input {
  constructor(input, send) {
    Object.assign(this, {input, send});
    const guess = 10 ** Math.ceil(Math.log10(Math.max(10, 2 * Math.abs(input.initial))));
    this.min = input.min ?? (input.max !== null && input.max < 0 ? input.max - guess : -guess);
    this.max = input.max ?? (input.min !== null && input.min > 0 ? input.min + guess : guess);
    this.slider = make("input", {type: "range", min: this.min, max: this.max, step: "any", value: input.initial});
    this.field = make("input", {type: "number", step: "any", value: input.initial});
    this.slider.oninput = () => this.set(Number(this.slider.value));
    this.field.onchange = () => this.set(Number(this.field.value));
    this.slider.setAttribute("aria-label", input.topic);
    this.ends = make("div", {className: "ends"});
    this.mark = make("i");
    this.force = make("span", {className: "force"});
    this.element = make("div", {className: "input"},
      make("div", {className: "name"}, make("b", {textContent: input.topic}), make("small", {textContent: input.hold.replaceAll("_", " ")})),
      this.slider, make("div", {className: "track"}, this.mark), this.ends,
      make("div", {className: "value"}, this.field, make("span", {textContent: input.unit}), make("span", {className: "gap"}), this.force));
    this.showEnds();
    this.sentAt = 0;
    this.untouched = true;
  }

  showEnds() {
    // Without a limit of the scene's the slider reaches as far as it has been asked to.
    Object.assign(this.slider, {min: this.min, max: this.max});
    this.ends.replaceChildren(
      make("span", {textContent: tick(this.min) + (this.input.min === null ? " (no limit)" : "")}),
      make("span", {textContent: tick(this.max) + (this.input.max === null ? " (no limit)" : "")}));
  }

  set(value) {
    if (!Number.isFinite(value)) return;
    this.untouched = false;
    if (this.input.min !== null) value = Math.max(value, this.input.min);
    if (this.input.max !== null) value = Math.min(value, this.input.max);
    if (value > this.max) this.max = value;
    if (value < this.min) this.min = value;
    this.showEnds();
    this.slider.value = value;
    this.field.value = Number(value.toPrecision(6));
    this.value = value;
    if (this.timer) return;  // the last value of a quick hand is sent too
    this.timer = setTimeout(() => {
      this.timer = null;
      this.sentAt = performance.now();
      this.send({command: {topic: this.input.topic, value: this.value}});
    }, Math.max(0, this.sentAt + SENDING - performance.now()));
  }

  tell(value) {
    this.mark.hidden = !Number.isFinite(value);
    if (this.mark.hidden) return;
    const share = Math.min(1, Math.max(0, (value - this.min) / (this.max - this.min)));
    this.mark.style.left = `${100 * share}%`;
    this.force.textContent = `in force ${show(value)}`;
    if (this.untouched) {
      this.slider.value = value;
      const shown = Math.abs(value) < 1e-6 * Math.min(1, this.max - this.min) ? 0 : Number(value.toPrecision(4));
      if (document.activeElement !== this.field) this.field.value = shown;
    }
  }
}

function fill(table, rows) {
  while (table.rows.length > rows.length) table.deleteRow(-1);
  rows.forEach(([name, value], i) => {
    const row = table.rows[i] ?? table.insertRow();
    if (!row.cells.length) row.append(make("td"), make("td"));
    if (row.cells[0].textContent !== name) row.cells[0].textContent = name;
    if (row.cells[1].textContent !== value) row.cells[1].textContent = value;
  });
}

export class Controls {
  constructor(send) {
    this.send = send;
    this.inputs = [];
    this.$ = (id) => document.getElementById(id);
    for (const call of ["pause", "resume", "reset", "reset_time"]) this.$(call).onclick = () => send({call});
    this.$("step").onclick = () => send({call: "step", arguments: {duration: Number(this.$("duration").value)}});
    const factor = this.$("wanted-factor");
    factor.onchange = () => {
      if (factor.value !== "") send({call: "set_parameters", arguments: {real_time_factor: Number(factor.value)}});
    };
  }

  setScene(words) {
    this.$("node").textContent = words.node;
    document.title = words.node + " – variator_sim";
    if (!words.scene) return;
    const key = JSON.stringify(words.inputs);
    if (key === this.key) return;
    this.key = key;
    this.inputs = words.inputs.map((input) => new Input(input, this.send));
    this.$("inputs").replaceChildren(...this.inputs.map((input) => input.element));
    if (!this.inputs.length) this.$("inputs").textContent = "This scene has none.";
  }

  wanted() {
    return this.inputs.map((input) => "inputs/" + input.input.topic);
  }

  setState(name, reason) {
    const badge = this.$("state");
    badge.textContent = name === "GONE" ? "NO NODE" : name;
    badge.className = "badge " + name;
    this.$("stop").textContent = reason;
  }

  disconnected() {
    this.setState("GONE", "the panel's server does not answer");
    this.enable(null);
  }

  enable(state) {
    const going = GOING.includes(state);
    this.$("pause").disabled = !going;
    this.$("resume").disabled = state !== "PAUSED";
    this.$("step").disabled = state !== "PAUSED";
    this.$("reset").disabled = this.$("reset_time").disabled = this.$("wanted-factor").disabled = state === null;
  }

  tell(frame) {
    const {status} = frame;
    const state = status ? STATES[status.state] ?? "?" : null;
    if (frame.alive && state) {
      this.setState(state, status.message);
    } else {
      this.setState("GONE", frame.silence === null ? "it has not been heard yet" : `silent for ${frame.silence.toFixed(0)} s`);
    }
    this.enable(frame.alive ? state : null);
    this.$("factor").textContent = frame.alive && status ? status.real_time_factor.toFixed(3) : "–";
    const factor = this.$("wanted-factor");
    const wanted = frame.settings.real_time_factor;
    if (wanted !== undefined && document.activeElement !== factor) factor.value = wanted;
    const time = frame.newest ?? status?.time;
    if (Number.isFinite(time)) this.$("time").textContent = time.toFixed(3);
    if (status) {
      fill(this.$("status"), [...STATUS.map(([key, name]) => [name, String(status[key])]),
        ["lateness p50, p99", `${(1e6 * status.lateness_p50).toFixed(0)}, ${(1e6 * status.lateness_p99).toFixed(0)} µs`]]);
    }
    const {diagnostics} = frame;
    const level = this.$("level");
    level.className = diagnostics && frame.alive ? "level" + diagnostics.level : "";
    level.textContent = diagnostics && frame.alive ? ["OK", "WARN", "ERROR", "STALE"][diagnostics.level] : "";
    this.$("summary").textContent = diagnostics && frame.alive ? diagnostics.message : "none yet";
    if (diagnostics) fill(this.$("diagnostics"), diagnostics.values);
    for (const input of this.inputs) input.tell(frame.latest["inputs/" + input.input.topic]);
  }

  answer(words) {
    const message = this.$("message");
    message.textContent = words.text;
    message.className = words.ok ? "fine" : "";
    clearTimeout(this.fading);
    this.fading = setTimeout(() => { message.textContent = ""; }, words.ok ? 3000 : 8000);
  }
}
