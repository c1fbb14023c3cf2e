"""The panel's web server: one page, one WebSocket for each browser that looks at it, what is saved."""

import asyncio
import json
import math
import os
import resource
import struct
import threading
import time

import numpy
import tornado.httpserver
import tornado.web
import tornado.websocket

import recording
from sample_table import decimate

FRAME = 1 / 30       # s between two frames of a browser, at least
HEARTBEAT = 0.25     # s, at most, also when nothing is new
BUCKETS = 400        # intervals of a window: two points each
MOST_NAMES = 2000    # columns in one message
IDLE = 60.0          # s after which a connection without a request is closed
DYGRAPHS = "/usr/share/javascript/dygraphs"
WEB = os.path.join(os.path.dirname(os.path.abspath(__file__)), "web")
HEADERS = {
    # The plotting library sets styles inline.
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; "
                               "style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data: blob:; "
                               "form-action 'none'; frame-ancestors 'none'; base-uri 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def check_names(names):
    """A list of columns: a frame, or a file, has each of them once."""
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError("columns: expected a list of names")
    if len(names) > MOST_NAMES:
        raise ValueError(f"columns: {len(names)} names; allowed: at most {MOST_NAMES}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"columns: {twice[:80]!r} is named more than once")
    return names


class Server(tornado.httpserver.HTTPServer):
    """Accepts while less than half of the descriptors are taken by browsers; where none is left it
    waits, too, instead of trying for ever."""

    def add_sockets(self, sockets):
        for sock in sockets:
            asyncio.get_running_loop().add_reader(sock, self._accept, sock)

    def _accept(self, sock):
        connection = None
        try:
            if len(self._connections) < resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2:
                connection, address = sock.accept()
        except (BlockingIOError, ConnectionAbortedError):
            return
        except OSError:
            pass
        if connection is None:
            loop = asyncio.get_running_loop()
            loop.remove_reader(sock)
            loop.call_later(0.5, loop.add_reader, sock, self._accept, sock)
        else:
            self._handle_connection(connection, address)


class Guarded:
    """Common first part of every handler of the panel."""

    def set_default_headers(self):
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def cookie_name(self):
        # Cookies know no ports.
        return "variator_sim_panel_" + self.request.host.rpartition(":")[2]

    def prepare(self):
        guard = self.application.guard
        host = self.request.headers.get("Host", "")
        if not guard.allows_host(host):
            raise tornado.web.HTTPError(403, reason="This name is not one of the panel's")
        try:
            is_own = guard.allows_origin(self.request.headers.get("Origin"), host)
        except ValueError as error:
            raise tornado.web.HTTPError(400, reason="Origin is no address") from error
        if not is_own or self.request.headers.get("Sec-Fetch-Site", "same-origin") == "cross-site":
            raise tornado.web.HTTPError(403, reason="Asked by a page of another host")
        given = self.get_query_argument("token", None)
        if guard.token is not None and given is not None and guard.allows_token(given):
            self.set_cookie(self.cookie_name(), given, httponly=True, samesite="Strict")
            self.redirect("/")
        elif not guard.allows_token(self.get_cookie(self.cookie_name())):
            raise tornado.web.HTTPError(403, reason="The token is missing or wrong: open the "
                                                    "address that the panel printed")

    def write_error(self, status_code, **kwargs):
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")


class Page(Guarded, tornado.web.StaticFileHandler):
    """Files of the page and of the plotting library."""

    def set_extra_headers(self, path):
        self.set_header("Cache-Control", "no-cache")


class Save(Guarded, tornado.web.RequestHandler):
    """GET /save.csv, /save.bag with columns (comma), begin, end (s)."""

    async def get(self, kind):
        link = self.application.link
        if link.scene is None:
            raise tornado.web.HTTPError(404, reason="There is no drivetrain yet")
        known = {column.name: group for group, found in link.columns.items() for column in found}
        try:
            names = [name for name in check_names(self.get_query_argument("columns", "").split(","))
                     if name in known]
        except ValueError as error:
            raise tornado.web.HTTPError(400, reason=str(error)) from error
        try:
            begin = float(self.get_query_argument("begin", "-inf"))
            end = float(self.get_query_argument("end", "inf"))
        except ValueError as error:
            raise tornado.web.HTTPError(400, reason="begin, end: not a number") from error
        if kind == "csv":
            self.set_header("Content-Type", "text/csv; charset=utf-8")
            write, what = recording.to_csv, (link.table, names)
        else:
            self.set_header("Content-Type", "application/octet-stream")
            groups = sorted({known[name] for name in names} | {"state"})
            write, what = recording.to_bag, (link, groups)
        # Long ones take seconds, in which pages go on.
        content = await asyncio.get_running_loop().run_in_executor(None, write, *what, begin, end)
        stem = link.node.strip("/").replace("/", "_")
        self.set_header("Content-Disposition", f'attachment; filename="{stem}.{kind}"')
        self.finish(content)


class Browser(Guarded, tornado.websocket.WebSocketHandler):
    """One page that is open. It asks for each frame when it has drawn the one before, so a slow or
    a hidden one gets fewer."""

    def open(self):  # pylint: disable=arguments-differ
        self.set_nodelay(True)
        self.columns, self.latest = [], []
        self.seconds, self.end = 30.0, None
        self.told_scene = None    # what was last told of each
        self.told_table = None
        self.told_columns = ()
        self.last_frame = 0.0
        self.pull = None
        self.application.browsers.add(self)
        self.application.look()

    def on_close(self):
        self.application.browsers.discard(self)
        self.application.look()

    def check_origin(self, origin):
        return True  # `prepare` has looked

    async def on_message(self, message):
        try:
            words = json.loads(message)
            if "show" in words:
                self._show(words["show"])
            if "pull" in words and (self.pull is None or self.pull.done()):
                self.pull = asyncio.ensure_future(self._answer_pull())
            if "command" in words:
                value = float(words["command"]["value"])
                self.application.link.command(words["command"]["topic"], value)
            if "call" in words:
                await self._call(words["call"], words.get("arguments", {}))
        except (ValueError, KeyError, TypeError) as error:
            self._tell({"kind": "answer", "ok": False, "text": str(error)})

    def _tell(self, words):
        if self.ws_connection is not None:
            self.write_message(json.dumps(words))

    def _show(self, view):
        """Sets the content of the page: columns over the last `seconds`, or those before `end`; the newest
        value of others."""
        self.columns, self.latest = check_names(view["columns"]), check_names(view["latest"])
        self.seconds = min(max(float(view["seconds"]), 0.1), 3600.0)
        self.end = None if view.get("end") is None else float(view["end"])
        self.told_table = None
        self.application.look()

    async def _call(self, service, arguments):
        loop = asyncio.get_running_loop()
        done = loop.create_future()

        def settle(ok, text):
            if not done.done():
                done.set_result({"kind": "answer", "ok": ok, "text": text, "call": service})

        def run():
            try:
                result = (True, self.application.link.call(service, **arguments))
            except Exception as error:  # pylint: disable=broad-except
                result = (False, f"{service}: {error}")
            loop.call_soon_threadsafe(settle, *result)

        # A thread of its own: a node that hangs must not hang the panel.
        threading.Thread(target=run, daemon=True).start()
        loop.call_later(10.0, settle, False, f"{service}: no answer within 10 s")
        self._tell(await done)

    async def _answer_pull(self):
        begin = time.monotonic()
        await asyncio.sleep(max(0.0, self.last_frame + FRAME - begin))
        link = self.application.link
        while self._has_told(link.table) and \
                link.scene_number == self.told_scene and time.monotonic() - begin < HEARTBEAT:
            await asyncio.sleep(FRAME)
        if self.ws_connection is None:
            return
        self.last_frame = time.monotonic()
        try:
            if link.scene_number != self.told_scene:
                self.told_scene = link.scene_number
                self._tell(self.application.describe_scene())
            self.application.look()
            await self.write_message(self._frame(link), binary=True)
        except tornado.websocket.WebSocketClosedError:
            pass

    def _has_told(self, table):
        """A picture that is held is told once."""
        if self.told_table is None:
            return False
        return self.end is not None or self.told_table == (table.version, table)

    def _frame(self, link):
        """uint32: length of the JSON behind it (a multiple of 8 with these four bytes); then the
        rows of the window as float64, column by column, time first."""
        table = link.table
        head = self.application.describe_status()
        head["latest"], head["latest_times"] = table.latest(self.latest), table.latest_times()
        rows = b""
        if not self._has_told(table):
            self.told_table = (table.version, table)
            known = {name for names in table.groups().values() for name in names}
            names = [name for name in self.columns if name in known]
            times, values = self._rows(table, names)
            rows = numpy.column_stack([times, values]).astype("<f8").tobytes("F")
            head.update(rows=len(times), columns=names)
        head["newest"] = table.newest_time()
        text = json.dumps(head).encode()
        text += b" " * (-(len(text) + 4) % 8)
        return struct.pack("<I", len(text)) + text + rows


    def _rows(self, table, names):
        """Times and values of the window, thinned to what a screen can show."""
        end = self.end if self.end is not None else table.newest_time()
        if end is None or not names:
            return numpy.empty(0), numpy.empty((0, len(names)))
        # A little more, so that curves reach the edges.
        _, times, values = table.window(names, end - 1.02 * self.seconds, end + 0.02 * self.seconds)
        heard = ~numpy.isnan(values).all(axis=1)
        return decimate(times[heard], values[heard], self.seconds / BUCKETS)


class Panel(tornado.web.Application):
    """`link` is the DrivetrainLink, `guard` says who may look."""

    def __init__(self, link, guard):
        self.link = link
        self.guard = guard
        self.browsers = set()
        super().__init__([
            (r"/socket", Browser),
            (r"/save\.(csv|bag)", Save),
            (r"/lib/(dygraph\.min\.(?:js|css))", Page, {"path": DYGRAPHS}),
            (r"/(.*)", Page, {"path": WEB, "default_filename": "index.html"}),
        ], websocket_ping_interval=10, websocket_max_message_size=1 << 20)

    def look(self):
        """Tells the link which groups are shown. The sliders do not subscribe to inputs at rest."""
        if not self.browsers:
            self.link.look_at(None)
            return
        group_of = {column.name: group for group, found in self.link.columns.items()
                    for column in found}

        def groups(field):
            return {group_of[name] for browser in self.browsers for name in getattr(browser, field)
                    if name in group_of}

        latest = groups("latest")
        if not self.link.inputs_move():
            latest.discard("inputs")
        self.link.look_at(groups("columns") | latest)

    def describe_scene(self):
        link = self.link
        if link.scene is None:
            return {"kind": "scene", "node": link.node, "scene": None}
        scene = link.scene
        return {"kind": "scene", "node": link.node, "scene": {
            "shafts": scene.shafts, "torques": scene.torques, "constraints": scene.constraints,
            "principle": scene.principle, "stepper": scene.stepper, "skips": scene.skips,
            "parameters": scene.parameters},
                "inputs": link.inputs, "explanation": link.explanation,
                "columns": [{"name": column.name, "unit": column.unit,
                             "quantity": column.quantity}
                            for found in link.columns.values() for column in found]}

    def describe_status(self):
        link = self.link
        words = {"kind": "frame", "alive": link.is_alive(), "silence": link.silence(),
                 "settings": link.settings, "status": None, "diagnostics": None}
        if link.status is not None:
            words["status"] = {name: plain(getattr(link.status, name))
                               for name in link.status.__slots__ if name != "header"}
        if link.diagnostics is not None:
            level = link.diagnostics.level
            words["diagnostics"] = {
                "level": level[0] if isinstance(level, bytes) else level,
                "message": link.diagnostics.message,
                "values": [[value.key, value.value] for value in link.diagnostics.values]}
        return words


def plain(value):
    """For JSON, which has no NaN."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
