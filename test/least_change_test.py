#!/usr/bin/python3
"""Compares what `simulate` prints of the principle with a derivation by SymPy.

From T = 1/2 J_ij omega_i omega_j alone: R_i = d/dt dT/domega_i - dT/dphi_i - Q_i, its time
derivative, the Christoffel symbols of J, G = R' - Gamma R omega, and the motion's G as the solution
of the stationarity conditions of the least 1/2 G' J^-1 G (gauss: of R = C' lambda, differentiated).
"""

import csv
import functools
import os
import pathlib
import random

import numpy as np
import roslib.packages
import rosunit
import sympy as sp
from scipy.integrate import solve_ivp

from support.scenes import scene_text
from support.simulate import SimulateTestCase

PACKAGE = "variator_sim"
FOLDER = pathlib.Path(roslib.packages.get_pkg_dir(PACKAGE))
#: Systems made at random; more on request.
SYSTEMS = int(os.environ.get("VARIATOR_SIM_RANDOM_SYSTEMS", "12"))
T = sp.Symbol("t")


class System:
    """A random scene, and its equations."""

    def __init__(self, seed):
        self.rng = random.Random(seed)
        self.s = s = self.rng.randint(2, 4)
        self.k = self.rng.randint(1, min(2, s - 1))
        self.principle = self.rng.choice(["generalized_gauss", "gauss"])
        self.levels = [[sp.Symbol(f"{name}{i + 1}") for i in range(s)]
                       for name in ("phi", "w", "e", "j")]
        self.orders = [self.rng.choice([1, 2] if self.principle == "gauss" else [1, 2, 3])
                       for _ in range(self.k)]
        self.inertia, self.inertia_text = self.make_inertia()
        self.torques = [self.make_torque(i) for i in range(s)]
        self.constraints = [self.make_constraint(m, order) for m, order in enumerate(self.orders)]

    def number(self, low=-1.0, high=1.0):
        return round(self.rng.uniform(low, high), 3)

    def make_general_inertia(self):
        """Entries that are formulas of all angles and the time."""
        phi, s = self.levels[0], self.s
        J, lines, couplings = sp.zeros(s, s), [], []
        for i in range(s):
            other = phi[self.rng.randrange(s)]
            J[i, i] = (self.number(1.5, 3.0) + self.number(-0.3, 0.3) * sp.cos(phi[i] - other)
                       * sp.sin(self.number(0.5, 2) * T)
                       + self.number(-0.3, 0.3) * sp.sin(other) ** 2)
            lines.append(f'shaft{i + 1}: {{inertia: "{self.written(J[i, i])}"}}')
        for i, j in ((i, j) for i in range(s) for j in range(i)):
            turned = phi[i] - self.number(0.5, 2) * phi[j]
            J[i, j] = J[j, i] = self.number(-0.2, 0.2) * sp.cos(turned)
            couplings.append(f'[shaft{i + 1}, shaft{j + 1}, "{self.written(J[i, j])}"]')
        return J, "\n".join(lines + [f"inertia_coupling: [{', '.join(couplings)}]"])

    def make_inertia(self):
        if self.rng.random() < 0.5:
            return self.make_general_inertia()
        phi, s = self.levels[0], self.s
        J, lines = sp.zeros(s, s), []
        for i in range(s):
            mean, order, c = self.number(1.5, 3.0), self.rng.randint(1, 3), self.number(-0.4, 0.4)
            J[i, i] = mean + c * sp.cos(order * phi[i])
            lines.append(f"shaft{i + 1}: {{inertia: {{mean: {mean}, harmonics: "
                         f"[{{order: {order}, cos: {c}, sin: 0.0}}]}}}}")
        c = self.number(-0.3, 0.3)
        J[0, 1] = J[1, 0] = c
        lines.append(f"inertia_coupling: [[shaft1, shaft2, {c}]]")
        return J, "\n".join(lines)

    def make_torque(self, i):
        phi, w = self.levels[:2]
        other = self.rng.randrange(self.s)
        return (self.number(-3, 3) * sp.sin(self.number(0.5, 3) * T) - self.number(0, 1) * w[i]
                + self.number() * sp.cos(phi[other]) * w[other] / 2)

    def make_constraint(self, m, order):
        """The shafts m and m + 1 above all, so that rows are independent."""
        phi, w, e, j = self.levels
        top = (w, e, j)[order - 1]
        ratio = self.number(0.5, 1.5) + self.number(-0.3, 0.3) * sp.sin(self.number(0.5, 2) * T)
        psi = top[m + 1] - ratio * top[m]
        if order == 1:
            return psi + self.number(-0.2, 0.2) * sp.sin(phi[m])
        if order == 2:
            bend = 0 if self.principle == "gauss" else self.number(-0.1, 0.1) * e[m] ** 2
            return psi + bend + self.number() * w[m + 1] - self.number() * w[m] + self.number() / 2
        return psi + self.number() * e[m] * w[m + 1] / 4

    def scene(self):
        names = [f"shaft{i + 1}" for i in range(self.s)]
        text = [f"shafts: [{', '.join(names)}]", self.inertia_text, f"principle: {self.principle}",
                f"torques: [{', '.join(f'q{i + 1}' for i in range(self.s))}]"]
        for i, torque in enumerate(self.torques):
            text.append(f"q{i + 1}: {{type: variator_sim/ExpressionTorque, shaft: {names[i]}, "
                        f'torque: "{self.written(torque)}"}}')
        text.append(f"constraints: [{', '.join(f'c{m + 1}' for m in range(self.k))}]")
        for m, psi in enumerate(self.constraints):
            text.append(f"c{m + 1}: {{type: variator_sim/ExpressionConstraint, order: "
                        f'{self.orders[m]}, expression: "{self.written(psi)}"}}')
        text.append(f"initial: {{velocity: {[self.number(0.5, 2) for _ in names]}, project: true}}")
        text.append("solver: {relative_tolerance: 1e-10, absolute_tolerance: 1e-10}")
        text.append("outputs: [z, length]")
        text.append('z: {expression: "Z"}')
        text.append('length: {expression: "sqrt(2*Z) + 0*G_shaft1"}')
        return "\n".join(text) + "\n"

    @staticmethod
    def written(expression):
        return str(expression).replace("**", "^")

    def rate(self, expression):
        """The derivative along the motion."""
        total = sp.diff(expression, T)
        for low, high in zip(self.levels, self.levels[1:]):
            for a, b in zip(low, high):
                total += sp.diff(expression, a) * b
        return total

    def reaction(self):
        phi, w = self.levels[:2]
        kinetic = sum(self.inertia[a, b] * w[a] * w[b] for a in range(self.s)
                      for b in range(self.s)) / 2
        return [self.rate(sp.diff(kinetic, w[i])) - sp.diff(kinetic, phi[i]) - self.torques[i]
                for i in range(self.s)]

    def connection(self, J, dJ, R, w):
        """Gamma^rho_sigma,tau R_rho omega_tau, of numbers; dJ: by the angles, then by the time."""
        s = self.s
        raised = np.linalg.solve(J, R)
        first = np.zeros((s, s, s))  # Gamma_kappa,sigma,tau
        for a in range(s):
            for b in range(s):
                for c in range(s):
                    first[a, b, c] = 0.5 * (dJ[c][a, b] + dJ[b][a, c] - dJ[a][b, c])
        return (np.einsum("abc,a,c->b", first, raised, w)
                + 0.5 * dJ[s] @ raised)

    @functools.cached_property
    def formulas(self):
        """Functions of (t, phi, w, e): those of the numbers that the equations are made of."""
        phi, w, e, j = self.levels
        zero = {symbol: 0 for symbol in j}
        third = []
        for psi, order in zip(self.constraints, self.orders):
            for _ in range(3 - order):
                psi = self.rate(psi)
            third.append(psi)
        R = self.reaction()
        C = [[sp.diff(psi, symbol) for symbol in j] for psi in third]
        formulas = {
            "J": self.inertia.tolist(), "R": R, "C": C,
            "dJ": [sp.diff(self.inertia, q).tolist() for q in [*phi, T]],
            "rest": [self.rate(it).subs(zero) for it in R],  # R' = J eta + rest
            "c0": [psi.subs(zero) for psi in third],
            "C_rest": [[self.rate(it).subs(zero) for it in row] for row in C],
            "C_by_jerk": [[[sp.diff(self.rate(it), symbol) for symbol in j] for it in row]
                          for row in C]}
        return {name: sp.lambdify([T, *phi, *w, *e], it, "numpy") for name, it in formulas.items()}

    def solve(self, values):
        """G, R, J and the jerk at a state, from the equations alone."""
        now = {name: np.array(of(*values), dtype=float) for name, of in self.formulas.items()}
        w = np.array(values[1 + self.s:1 + 2 * self.s])
        turn = self.connection(now["J"], now["dJ"], now["R"], w)
        if self.principle == "generalized_gauss":
            matrix, right = now["J"], turn - now["rest"]
        else:  # R = C' lambda, and so is its rate
            lam = np.linalg.lstsq(now["C"].T, now["R"], rcond=None)[0]
            matrix = now["J"] - np.einsum("m,mij->ij", lam, now["C_by_jerk"])
            right = lam @ now["C_rest"] - now["rest"]
        saddle = self.saddle(matrix, -now["C"].T, now["C"])
        eta = np.linalg.solve(saddle, np.concatenate([right, -now["c0"]]))[:self.s]
        return now["J"] @ eta + now["rest"] - turn, now["R"], now["J"], eta

    def at(self, values):
        """G, Z and the constraint measure."""
        G, R, J, _ = self.solve(values)
        return G, 0.5 * G @ np.linalg.solve(J, G), 0.5 * R @ np.linalg.solve(J, R)

    def move(self, values, end):
        """The state at `end`, by DOP853."""
        def rates(t, x):
            return np.concatenate([x[self.s:], self.solve([t, *x])[3]])
        solution = solve_ivp(rates, (values[0], end), values[1:], "DOP853", rtol=1e-11, atol=1e-11)
        return solution.y[:, -1]

    @staticmethod
    def saddle(J, upper, lower):
        return np.block([[J, upper], [lower, np.zeros((lower.shape[0], upper.shape[1]))]])


class LeastChangeTest(SimulateTestCase):

    def check_system(self, system):
        scene = self.write("scene.yaml", system.scene())
        result = self.simulate(scene, "--times", "0.1,0.4", "--columns", "state,outputs,principle",
                               "--set", "solver/machine_code=never")
        if result.returncode == 1:
            return False  # the motion ends
        self.assertEqual(result.returncode, 0, result.stderr)
        rows, states = list(csv.DictReader(result.stdout.splitlines())), []
        names = [f"shaft{i + 1}/" for i in range(system.s)]
        for row in rows:
            values = [float(row["time"])] + [float(row[name + of]) for of in
                                             ("angle", "velocity", "acceleration")
                                             for name in names]
            states.append(values)
            G, Z, constraint_measure = system.at(values)
            scale = max(1.0, np.abs(G).max())
            for name, expected in zip(names, G):
                told = float(row[name + "reaction_torque_covariant_rate"])
                self.assertLess(abs(told - expected), 1e-10 * scale, name)
            self.assertLess(abs(float(row["principle/Z"]) - Z), 1e-10 * scale ** 2)
            self.assertLess(abs(float(row["principle/constraint_measure"]) - constraint_measure),
                            1e-10 * max(1.0, constraint_measure))
            self.assertEqual(row["outputs/z"], row["principle/Z"])
            self.assertAlmostEqual(float(row["outputs/length"]), (2 * Z) ** 0.5, delta=1e-9 * scale)
        moved = system.move(states[0], 0.4)
        np.testing.assert_allclose(states[1][1:], moved, rtol=1e-7, atol=1e-7)
        checked = self.simulate(scene, "--duration", "0.4", "--check-minimum", "--set",
                                "solver/machine_code=never")
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)
        return True

    def test_g_and_z_are_those_of_the_principle(self):
        seen = 0
        for seed in range(SYSTEMS):
            with self.subTest(seed=seed):
                seen += self.check_system(System(seed))
        self.assertGreater(seen, 0.6 * SYSTEMS)

    def test_z_along_the_admissible_directions_is_least_at_the_motion(self):
        curves = self.folder / "curves.csv"
        result = self.check_simulate(str(FOLDER / "config/ship.yaml"), "--times", "0,1,2.5",
                                     "--check-minimum", "--curves", str(curves))
        self.assertIn("generalized_gauss", result.stdout)
        with open(curves, encoding="utf-8") as file:
            rows = [{key: float(value) for key, value in row.items()}
                    for row in csv.DictReader(file)]
        self.assertEqual({row["time"] for row in rows}, {0.0, 1.0, 2.5})
        for time in {row["time"] for row in rows}:
            here = [row for row in rows if row["time"] == time]
            least = next(row for row in here if row["step"] == 0.0)
            for row in here:  # h' J h = 1
                self.assertAlmostEqual(row["Z"], least["Z"] + 0.5 * row["step"] ** 2,
                                       delta=1e-9 * (1 + row["Z"]))

    def test_what_makes_nothing_least_is_refused_by_name(self):
        scene = """
shafts: [a, b]
a: {inertia: 1}
b: {inertia: 2}
torques: [m]
m: {type: variator_sim/ExpressionTorque, shaft: a, torque: "sin(t)"}
constraints: [gear]
gear: {type: variator_sim/ExpressionConstraint, %s}
principle: %s
"""
        order3 = 'order: 3, expression: "j_b - 2*j_a"'
        bent = 'order: 2, expression: "e_b - 2*e_a + abs(e_a)"'
        turned = 'order: 1, expression: "w_b - 2*w_a", reaction: {a: -1, b: 1}'
        for keys, principle, word in ((order3, "gauss", "[18]"), (bent, "gauss", "corner"),
                                      (turned, "gauss", "gradient")):
            with self.subTest(keys=keys):
                self.check_refused([self.write("scene.yaml", scene % (keys, principle)),
                                    "--duration", "1", "--check-minimum"], "gear", word)
        for keys in (order3, bent):
            self.check_simulate(self.write("scene.yaml", scene % (keys, "generalized_gauss")),
                                "--duration", "1", "--check-minimum")

    def test_elements_that_hold_and_commands_are_checked_in_their_modes(self):
        for name in ("holding/locomotive_sticking", "diesel_locomotive"):
            path = FOLDER / "config/applications" / (name + ".yaml")
            commands = path.with_suffix(".csv")
            more = ["--commands", str(commands)] if commands.exists() else []
            self.check_simulate(str(path), "--duration", "20", "--rate", "10", "--check-minimum",
                                *more)

    def test_principles_beside_each_other(self):
        scene = scene_text("a 1.5, b 2.5", [
            "m on a: 3 + sin(t) - 0.2*w_a",
            "gear: e_b - (RATIO)*e_a"], "solver: {relative_tolerance: 1e-11, absolute_tolerance: 1e-11}")
        for ratio, least, most in (("0.6", 0.0, 1e-8), ("0.6+0.2*sin(t)", 0.01, 10.0)):
            path = self.write("scene.yaml", scene.replace("RATIO", ratio))
            result = self.check_simulate(path, "--duration", "5", "--compare-principles",
                                         "--output", str(self.folder / "run.csv"))
            self.assertEqual(result.stdout.count("difference by [10] and [16]"), 2)
            runs = {}
            for name in ("generalized_gauss", "gauss", "formal"):
                with open(self.folder / f"run_{name}.csv", encoding="utf-8") as file:
                    runs[name] = np.array([float(row["b/velocity"]) for row in csv.DictReader(file)])
            self.assertEqual(len(runs["gauss"]), 501)
            difference = np.abs(runs["gauss"] - runs["generalized_gauss"]).max()
            self.assertGreaterEqual(difference, least)
            self.assertLess(difference, most)
            # [17] and [18] are one motion from a start whose reaction is in range(C').
            np.testing.assert_allclose(runs["gauss"], runs["formal"], atol=1e-8)

    def test_inertias_by_formulas_are_refused_or_stop_by_name(self):
        scene = """
shafts: [spindle, arm]
spindle: {inertia: "0.5 + 1.28*sin(phi_arm)^2"}
arm: {inertia: 1.28}
inputs: [fill]
fill: {topic: fill, hold: zero_order}
torques: [load]
load: {type: variator_sim/ExpressionTorque, shaft: arm, torque: "sin(t) + fill"}
initial: {velocity: [1, 0]}
"""
        for text, *words in (("1.28*w_arm", "arm/inertia", "velocity"),
                             ("1.28 + 0.1*abs(phi_arm)", "arm/inertia", "abs"),
                             ("1.28 + 0.1*fill", "arm/inertia", "fill", "second_order_lag"),
                             ("0.1 - t - 1", "positive definite", "-0.9"),
                             ("1 + q", "arm/inertia", "q")):
            with self.subTest(text=text):
                changed = scene.replace("inertia: 1.28}", f'inertia: "{text}"}}')
                self.check_refused([self.write("scene.yaml", changed), "--duration", "1"], *words)
        unknown = scene.replace("inertia: 1.28}", 'inertia: "1 + 0.1*sin(t)", foo: 3}')
        self.check_refused([self.write("scene.yaml", unknown), "--duration", "1"], "foo")
        falling = scene.replace("inertia: 1.28}", 'inertia: "1.28 - 0.5*t"}')
        stopped = self.simulate(self.write("scene.yaml", falling), "--duration", "5")
        self.assertEqual(stopped.returncode, 1)
        self.assertIn("IndefiniteInertia at t = 2.5", stopped.stderr)
        self.check_refused([self.write("scene.yaml", scene), "--explain"], "inertia")
        for stepper in ("radau", "fehlberg78"):
            self.check_simulate(self.write("scene.yaml", scene), "--duration", "1", "--set",
                                "solver/stepper=" + stepper)

    def test_an_inertia_moved_by_an_input_and_runs_that_go_on(self):
        scene = self.write("scene.yaml", """
shafts: [a, b]
a: {inertia: "2 + fill*(1+c*cos(phi_b))", parameters: {c: 0.2}}
b: {inertia: 1.0}
inertia_coupling: [[a, b, "0.2*cos(phi_a - phi_b)"]]
inputs: [fill]
fill: {topic: fill, hold: second_order_lag, time_constant: 0.3, initial: 0.5}
torques: [q]
q: {type: variator_sim/ExpressionTorque, shaft: a, torque: "sin(2*t)"}
constraints: [c]
c: {type: variator_sim/ExpressionConstraint, order: 2, expression: "e_b - (1.5+0.2*sin(t))*e_a"}
initial: {velocity: [1, 2]}
""")
        commands = self.write("fill.csv", "time,topic,value\n0.5,fill,2\n1.5,fill,0.2\n")
        for principle in ("generalized_gauss", "gauss"):
            checked = ["--set", "principle=" + principle, "--commands", commands]
            self.check_simulate(scene, "--duration", "3", "--check-minimum", *checked)
        run = [scene, "--commands", commands, "--rate", "4"]
        outputs = [self.check_simulate(*run, "--duration", "3", "--set",
                                       "solver/machine_code=" + how).stdout
                   for how in ("never", "always")]
        self.assertEqual(*outputs)
        state = str(self.folder / "state.yaml")
        self.check_simulate(*run, "--duration", "1", "--save-state", state)
        rest = self.check_simulate(*run, "--duration", "1", "--from-state", state).stdout
        whole = self.check_simulate(*run, "--duration", "2").stdout
        for a, b in zip(rest.splitlines()[-1].split(","), whole.splitlines()[-1].split(",")):
            self.assertAlmostEqual(float(a), float(b), delta=1e-7)

    def test_only_outputs_read_the_principle(self):
        text = scene_text("a 1", [], "states: [s]", 's: {rate: "G_a"}')
        self.check_refused([self.write("scene.yaml", text), "--duration", "1"], "G_a", "outputs")


if __name__ == "__main__":
    rosunit.unitrun(PACKAGE, "least_change_test", LeastChangeTest)
