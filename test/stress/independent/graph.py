"""Formulas as graphs: exact derivatives and straight-line Python code.

Every operation is kept once (equal ones are the same node). A function with a kink is split into a smooth
formula and a mode: abs(x) = m x with m = sign of x, which stays as it is between two events. So what
an integrator sees is smooth, and kinks are met by finding the zeros of guards.
"""
import ast
import math


class Node:
    """One operation; made by the functions below only."""
    __slots__ = ("op", "arguments", "number", "_value")

    def __init__(self, op, arguments, number):
        self.op, self.arguments, self.number = op, arguments, number

    def __add__(self, other):
        return add(self, wrap(other))

    def __radd__(self, other):
        return add(wrap(other), self)

    def __sub__(self, other):
        return add(self, multiply(wrap(-1.0), wrap(other)))

    def __rsub__(self, other):
        return add(wrap(other), multiply(wrap(-1.0), self))

    def __mul__(self, other):
        return multiply(self, wrap(other))

    def __rmul__(self, other):
        return multiply(wrap(other), self)

    def __truediv__(self, other):
        return divide(self, wrap(other))

    def __rtruediv__(self, other):
        return divide(wrap(other), self)

    def __neg__(self):
        return multiply(wrap(-1.0), self)

    def __pow__(self, exponent):
        return power(self, wrap(exponent))


_nodes = {}


def _make(op, *arguments):
    key = (op,) + tuple(a.number if isinstance(a, Node) else ("raw", repr(a)) for a in arguments)
    node = _nodes.get(key)
    if node is None:
        node = _nodes[key] = Node(op, arguments, len(_nodes))
    return node


def forget():
    """Empties the store of nodes: graphs of one scene mean nothing to the next."""
    _nodes.clear()


def wrap(x):
    return x if isinstance(x, Node) else _make("number", float(x))


def variable(name):
    return _make("variable", name)


def is_number(x, value=None):
    return x.op == "number" and (value is None or x.arguments[0] == value)


def add(a, b):
    if is_number(a) and is_number(b):
        return wrap(a.arguments[0] + b.arguments[0])
    if is_number(a, 0.0):
        return b
    if is_number(b, 0.0):
        return a
    return _make("+", a, b)


def multiply(a, b):
    if is_number(a) and is_number(b):
        return wrap(a.arguments[0] * b.arguments[0])
    if is_number(a, 0.0) or is_number(b, 0.0):
        return wrap(0.0)
    if is_number(a, 1.0):
        return b
    if is_number(b, 1.0):
        return a
    return _make("*", a, b)


def divide(a, b):
    if is_number(a) and is_number(b) and b.arguments[0] != 0.0:
        return wrap(a.arguments[0] / b.arguments[0])
    if is_number(a, 0.0):
        return a
    if is_number(b, 1.0):
        return a
    return _make("/", a, b)


def power(a, b):
    if is_number(b):
        c = b.arguments[0]
        if c == 0.0:
            return wrap(1.0)
        if c == 1.0:
            return a
        if is_number(a):
            return wrap(a.arguments[0] ** c)
        if c == int(c) and abs(c) <= 8:
            return _make("integer_power", a, int(c))
        return _make("power", a, b)
    return exp(b * log(a))


def call(name, x):
    x = wrap(x)
    if is_number(x):
        return wrap(getattr(math, name)(x.arguments[0]))
    return _make(name, x)


def sin(x):
    return call("sin", x)


def cos(x):
    return call("cos", x)


def tanh(x):
    return call("tanh", x)


def sinh(x):
    return call("sinh", x)


def cosh(x):
    return call("cosh", x)


def exp(x):
    return call("exp", x)


def log(x):
    return call("log", x)


def sqrt(x):
    return call("sqrt", x)


def atan(x):
    return call("atan", x)


def atan2(y, x):
    return _make("atan2", wrap(y), wrap(x))


# The derivative of f(x) as a graph.
SLOPES = {
    "sin": cos,
    "cos": lambda x: -sin(x),
    "tan": lambda x: 1 + call("tan", x) ** 2,
    "asin": lambda x: 1 / sqrt(1 - x * x),
    "acos": lambda x: -1 / sqrt(1 - x * x),
    "atan": lambda x: 1 / (1 + x * x),
    "sinh": cosh,
    "cosh": sinh,
    "tanh": lambda x: 1 - tanh(x) ** 2,
    "exp": exp,
    "log": lambda x: 1 / x,
    "sqrt": lambda x: 0.5 / sqrt(x),
}


class Modes:
    """The quantity frozen between two events: the sign of an argument, or the piece of a table."""

    def __init__(self):
        self.guards = []  # of a sign: (node,); of a table: (node, knots)
        self.index = {}

    def sign_of(self, x):
        if is_number(x):
            return wrap(math.copysign(1.0, x.arguments[0]) if x.arguments[0] else 0.0)
        key = (x.number,)
        if key not in self.index:
            self.index[key] = len(self.guards)
            self.guards.append((x, None))
        return _make("mode", self.index[key])

    def abs(self, x):
        return self.sign_of(x) * x

    def max(self, a, b):
        return 0.5 * (a + b) + 0.5 * self.abs(a - b)

    def min(self, a, b):
        return 0.5 * (a + b) - 0.5 * self.abs(a - b)

    def piece(self, table, x):
        """table(x); a table has `knots` and `polynomial(piece, derivative)`."""
        if is_number(x):
            return wrap(table(x.arguments[0]))
        key = (x.number, id(table))
        if key not in self.index:
            self.index[key] = len(self.guards)
            self.guards.append((x, table))
        return _make("table", self.index[key], 0, x)


def derive(root, seeds, memory=None):
    """The derivative of `root` where each variable's is seeds[name] (0 if it is not there)."""
    memory = {} if memory is None else memory
    zero = wrap(0.0)

    def visit(n):
        found = memory.get(n.number)
        if found is not None:
            return found
        op = n.op
        if op in ("number", "mode"):
            d = zero
        elif op == "variable":
            d = wrap(seeds.get(n.arguments[0], 0.0))
        elif op == "+":
            d = visit(n.arguments[0]) + visit(n.arguments[1])
        elif op == "*":
            a, b = n.arguments
            d = visit(a) * b + a * visit(b)
        elif op == "/":
            a, b = n.arguments
            d = visit(a) / b - n * visit(b) / b
        elif op == "integer_power":
            a, c = n.arguments
            d = visit(a)
            d = d if is_number(d, 0.0) else c * power(a, wrap(c - 1)) * d
        elif op == "power":
            a, c = n.arguments
            d = visit(a)
            d = d if is_number(d, 0.0) else c * power(a, c - 1) * d
        elif op == "atan2":
            y, x = n.arguments
            d = (visit(y) * x - y * visit(x)) / (x * x + y * y)
        elif op == "table":
            mode, order, x = n.arguments
            d = visit(x)
            d = d if is_number(d, 0.0) else _make("table", mode, order + 1, x) * d
        else:
            x = n.arguments[0]
            d = visit(x)
            d = d if is_number(d, 0.0) else SLOPES[op](x) * d
        memory[n.number] = d
        return d

    return visit(root)


def reads(root, names):
    """Whether `root` contains one of the variables `names`."""
    seen, stack = set(), [root]
    while stack:
        n = stack.pop()
        if n.number in seen:
            continue
        seen.add(n.number)
        if n.op == "variable" and n.arguments[0] in names:
            return True
        stack.extend(a for a in n.arguments if isinstance(a, Node))
    return False


def compile_function(outputs, signature, tables):
    """A function of `signature` (a dictionary: list argument -> names in it, None for a scalar) that
    returns the values of `outputs`, nested lists of nodes. Modes are read from its argument M."""
    order, seen = [], set()

    def collect(n):
        stack = [(n, False)]
        while stack:
            node, done = stack.pop()
            if done:
                order.append(node)
                continue
            if node.number in seen:
                continue
            seen.add(node.number)
            stack.append((node, True))
            stack.extend((a, False) for a in node.arguments if isinstance(a, Node))

    def flat(x):
        if isinstance(x, (list, tuple)):
            for y in x:
                flat(y)
        else:
            collect(x)

    flat(outputs)
    lines = []
    for argument, names in signature.items():
        if names:
            lines.append(f"({', '.join(names)},) = {argument}")

    def ref(n):
        if n.op == "number":
            return f"({n.arguments[0]!r})"
        if n.op == "variable":
            return n.arguments[0]
        return f"v{n.number}"

    for n in order:
        a = n.arguments
        if n.op in ("number", "variable"):
            continue
        if n.op in ("+", "*", "/"):
            code = f"{ref(a[0])} {n.op} {ref(a[1])}"
        elif n.op == "integer_power":
            code = f"{ref(a[0])} ** {a[1]}"
        elif n.op == "power":
            code = f"{ref(a[0])} ** {ref(a[1])}"
        elif n.op == "mode":
            code = f"M[{a[0]}]"
        elif n.op == "atan2":
            code = f"atan2({ref(a[0])}, {ref(a[1])})"
        elif n.op == "table":
            code = f"T[{a[0]}].evaluate(M[{a[0]}], {a[1]}, {ref(a[2])})"
        else:
            code = f"{n.op}({ref(a[0])})"
        lines.append(f"v{n.number} = {code}")

    def show(x):
        if isinstance(x, (list, tuple)):
            return "(" + "".join(show(y) + ", " for y in x) + ")"
        return ref(x)

    lines.append(f"return {show(outputs)}")
    text = f"def function({', '.join(signature)}):\n    " + "\n    ".join(lines)
    space = {name: getattr(math, name) for name in (*SLOPES, "atan2")}
    space["T"] = tables
    exec(compile(text, "<graph>", "exec"), space)
    return space["function"]


FUNCTIONS = {"sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt"}


def parse(text, names, modes):
    """The formula `text` as a graph; `names` are what it may contain. doc/scene.md, Formulas."""

    def visit(n):
        if isinstance(n, ast.Expression):
            return visit(n.body)
        if isinstance(n, ast.Constant) and isinstance(n.value, (int, float)):
            return wrap(n.value)
        if isinstance(n, ast.Name):
            if n.id == "pi":
                return wrap(math.pi)
            return wrap(names[n.id])
        if isinstance(n, ast.UnaryOp):
            x = visit(n.operand)
            return -x if isinstance(n.op, ast.USub) else x
        if isinstance(n, ast.BinOp):
            a, b = visit(n.left), visit(n.right)
            return {ast.Add: lambda: a + b, ast.Sub: lambda: a - b, ast.Mult: lambda: a * b,
                    ast.Div: lambda: a / b, ast.Pow: lambda: a ** b}[type(n.op)]()
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name):
            x = [visit(a) for a in n.args]
            f = n.func.id
            if f in FUNCTIONS:
                return call(f, *x)
            return {"abs": modes.abs, "sign": modes.sign_of, "min": modes.min, "max": modes.max,
                    "pow": power, "atan2": atan2}[f](*x)
        raise ValueError(f"cannot read {ast.dump(n)} of {text!r}")

    return visit(ast.parse(str(text).strip().replace("^", "**"), mode="eval"))
