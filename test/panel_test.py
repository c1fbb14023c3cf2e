#!/usr/bin/python3
"""The panel: what it serves to whom, what it keeps and saves, and its page in a real browser."""

import asyncio
import csv
import ctypes
import errno
import io
import json
import os
import pathlib
import re
import resource
import signal
import socket as tcp
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request
import xmlrpc.client

import numpy
import rosbag
import roslib.packages
import rosparam
import rospkg
import rospy
import rostest
import tornado.httpclient
import tornado.web
import tornado.websocket
from variator_sim.msg import SimulationStatus

PACKAGE = pathlib.Path(rospkg.RosPack().get_path('variator_sim'))
sys.path[:0] = [str(PACKAGE / 'panel'), str(PACKAGE / 'test')]

# pylint: disable=wrong-import-position
from guard import Guard
from sample_table import SampleTable, decimate
from server import Server
from support.browser import Browser, find_browser
from support.node_client import PATIENCE, NodeClient, wait_for
from variator_sim.nodes import drivetrains

SCENE = PACKAGE / 'test/scenes/observed.yaml'
NODE = roslib.packages.find_node('variator_sim', 'variator_sim_node')[0]
PANEL = str(PACKAGE / 'scripts/panel')


def nanoseconds(status):
    return round(1e9 * status.time)


def die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


class Drivetrain:
    """A node that can be killed and started again."""

    def __init__(self, name, scene=None, **settings):
        self.name = name
        scene = scene or rosparam.load_file(str(SCENE))[0][0]
        rosparam.upload_params('/' + name, {**scene, **settings})
        self.start()

    def start(self):
        self.process = subprocess.Popen([NODE, '__name:=' + self.name], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL, preexec_fn=die_with_parent)

    def kill(self):
        self.process.kill()
        self.process.wait()


def many_shafts():
    """A scene of 64 shafts with a torque each, and of 31 inputs, one of them with far limits."""
    shafts = [f'shaft_number_{n}' for n in range(64)]
    inputs = [f'input_{n}' for n in range(31)]
    scene = {'shafts': shafts, 'inputs': inputs, 'torques': ['at_' + shaft for shaft in shafts],
             'initial': {'velocity': [1.0 + n % 9 for n in range(64)]}}
    for n, shaft in enumerate(shafts):
        scene[shaft] = {'inertia': 1e6}  # so speeds, and the signs of powers, stay
        scene['at_' + shaft] = {'type': 'variator_sim/ExpressionTorque', 'shaft': shaft,
                                'torque': f'{n - 20.5} + 1e-9*input_{n % 31}'}
    for n, name in enumerate(inputs):
        limit = 1e7 if n == 0 else 100.0
        scene[name] = {'topic': name, 'initial': 5.0, 'min': -limit, 'max': limit}
    return scene


class PanelProcess:
    """The program, on a free port."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([sys.executable, PANEL, '--port', '0', *arguments],
                                        stdout=subprocess.PIPE, text=True,
                                        preexec_fn=die_with_parent)
        line = self.process.stdout.readline()
        self.url = re.search(r'http://\S+', line)[0]
        self.port = int(re.search(r':(\d+)/', self.url)[1])
        self.root = f'http://127.0.0.1:{self.port}'

    def get(self, path='/', **headers):
        """(status, body); headers as host='...' ."""
        request = urllib.request.Request(self.root + path, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def has_all_subscribers(self):
        """Whether every subscriber of what the panel publishes has connected to it."""
        master = rospy.get_master()
        published, subscribed, _ = master.getSystemState()[2]
        subscribed = dict(subscribed)
        for node in {node for _, nodes in published for node in nodes if 'panel' in node}:
            server = xmlrpc.client.ServerProxy(master.lookupNode(node)[2])
            if server.getPid('/panel_test')[2] != self.process.pid:
                continue
            wanted = {topic for topic, nodes in published if node in nodes and topic in subscribed}
            connected = [entry[4] for entry in server.getBusInfo('/panel_test')[2]
                         if entry[2] == 'o' and entry[5]]
            return all(connected.count(topic) >= len(subscribed[topic]) for topic in wanted)
        return False

    def close(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(PATIENCE)
        self.process.stdout.close()


class Socket:
    """The messages that a page sends and receives."""

    def __init__(self, panel, **headers):
        self._loop = asyncio.new_event_loop()
        request = tornado.httpclient.HTTPRequest(f'ws://127.0.0.1:{panel.port}/socket',
                                                 headers=headers)
        self._socket = self._await(lambda: tornado.websocket.websocket_connect(request))
        self.scene = None

    def _await(self, begin):
        async def wait():
            return await asyncio.wait_for(begin(), PATIENCE)

        return self._loop.run_until_complete(wait())

    def say(self, **words):
        self._socket.write_message(json.dumps(words))

    def hear(self):
        return self._await(self._socket.read_message)

    def frame(self):
        """Head and matrix (time first) of the next frame."""
        self.say(pull=1)
        while True:
            message = self.hear()
            if isinstance(message, bytes):
                size = struct.unpack('<I', message[:4])[0]
                head = json.loads(message[4:4 + size])
                matrix = numpy.frombuffer(message[4 + size:])
                rows = head.get('rows', 0)
                return head, matrix.reshape(-1, rows).T if rows else None
            if json.loads(message)['kind'] == 'scene':
                self.scene = json.loads(message)

    def answer(self):
        while True:
            message = self.hear()
            if isinstance(message, str) and json.loads(message)['kind'] == 'answer':
                return json.loads(message)

    def frames_until(self, condition, what):
        return wait_for(lambda: next((pair for pair in [self.frame()] if condition(*pair)), None),
                        what)

    def close(self):
        self._socket.close()
        self._loop.close()


class TableTest(unittest.TestCase):

    def test_rows_of_one_instant_meet(self):
        table = SampleTable()
        table.add_group('state', ['a', 'b'])
        table.put('state', 1, 0.1, [1, 2])
        table.add_group('inputs', ['c'])
        table.put('state', 2, 0.2, [3, 4])
        table.put('inputs', 1, 0.1, [5])
        table.put('inputs', 2, 0.2, [6])
        table.put('inputs', 3, 0.3, [7])
        table.put('state', 3, 0.3, [8, 9])
        _, times, values = table.window(['b', 'c'])
        self.assertEqual(times.tolist(), [0.1, 0.2, 0.3])
        self.assertEqual(values.tolist(), [[2, 5], [4, 6], [9, 7]])
        self.assertEqual(table.latest(['a', 'c', 'no']), {'a': 8, 'c': 7})
        self.assertEqual(table.latest_times(), {'state': 0.3, 'inputs': 0.3})

    def test_time_that_jumps_back_begins_anew(self):
        table = SampleTable()
        table.add_group('state', ['a'])
        for time_now in (1.0, 2.0, 0.0, 0.5):
            table.put('state', int(1e9 * time_now), time_now, [time_now])
        self.assertEqual(table.window(['a'])[1].tolist(), [0.0, 0.5])

    def test_the_oldest_are_forgotten_within_a_bound(self):
        table = SampleTable(limit=2e5)
        table.add_group('state', ['a', 'b'])
        for i in range(50000):
            table.put('state', i, float(i), [i, -i])
        _, times, values = table.window(['a', 'b'])
        self.assertEqual(times[-1], 49999.0)
        self.assertTrue(4096 / 2 < len(times) < 2e5 / 16)
        self.assertTrue((numpy.diff(times) == 1).all() and (values[:, 0] == times).all())

    def test_no_peak_is_lost(self):
        times = numpy.arange(100000) * 1e-3
        values = numpy.sin(times)[:, None] * [1.0, -2.0]
        values[54321] = [40.0, numpy.nan]
        few_times, few = decimate(times, values, 0.25)
        self.assertLessEqual(len(few_times), 2 * 401)
        self.assertEqual(few[:, 0].max(), 40.0)
        self.assertEqual(numpy.nanmin(few[:, 1]), numpy.nanmin(values[:, 1]))
        self.assertTrue((numpy.diff(few_times) >= 0).all())
        # The same intervals when a little later more has come: the picture stands still.
        again_times, again = decimate(times[1000:90000], values[1000:90000], 0.25)
        self.assertTrue(set(again_times[4:-4]) <= set(few_times))
        self.assertTrue(set(again[4:-4, 0]) <= set(few[:, 0]))

    def test_few_rows_stay_as_they_are(self):
        times, values = numpy.array([0.0, 1.0, 2.0]), numpy.array([[1.0], [5.0], [2.0]])
        self.assertIs(decimate(times, values, 0.5)[1], values)


class GuardTest(unittest.TestCase):

    def test_names(self):
        guard = Guard('127.0.0.1')
        for host in ('localhost:8421', '127.0.0.1:1', '[::1]:8421', 'LOCALHOST'):
            self.assertTrue(guard.allows_host(host), host)
        for host in ('evil.example:8421', '10.0.0.1:8421', '', 'localhost.evil.example', '[::1'):
            self.assertFalse(guard.allows_host(host), host)
        self.assertTrue(Guard('127.0.0.1', ['rig']).allows_host('rig:80'))

    def test_beyond_loopback_only_with_a_token(self):
        for address in ('0.0.0.0', '10.0.0.1', '::'):
            with self.assertRaises(ValueError):
                Guard(address)
        guard = Guard('0.0.0.0', token='secret')
        self.assertTrue(guard.allows_host('10.0.0.1:8421'))
        self.assertFalse(guard.allows_host('evil.example:8421'))
        self.assertTrue(guard.allows_token('secret'))
        self.assertFalse(guard.allows_token('Secret'))
        self.assertFalse(guard.allows_token(None))


class FullSocket(tcp.socket):
    """Listens, without a descriptor left for a connection."""

    tries = 0

    def accept(self):
        self.tries += 1
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))


class AcceptTest(unittest.TestCase):

    def test_what_fails_is_tried_again_after_a_while(self):
        with FullSocket() as full:
            full.bind(('127.0.0.1', 0))
            full.listen()
            full.setblocking(False)

            async def serve():
                Server(tornado.web.Application()).add_sockets([full])
                await asyncio.sleep(0.7)

            with tcp.create_connection(full.getsockname()):
                loop = asyncio.new_event_loop()
                loop.run_until_complete(serve())
                loop.close()
            self.assertIn(full.tries, (1, 2))


class ServerTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.node = Drivetrain('served')
        cls.client = NodeClient('served', states=False)
        cls.panel = PanelProcess('--node', '/served')

    @classmethod
    def tearDownClass(cls):
        cls.panel.close()
        cls.client.close()
        cls.node.kill()

    def test_page_and_library_come_from_here(self):
        status, page = self.panel.get()
        self.assertEqual(status, 200)
        for path in re.findall(r'(?:src|href)="([^"]+)"', page.decode()):
            self.assertNotIn(':', path)
            self.assertEqual(self.panel.get('/' + path)[0], 200, path)

    def test_other_names_and_other_pages_are_refused(self):
        self.assertEqual(self.panel.get(Host='evil.example')[0], 403)
        self.assertEqual(self.panel.get(Origin='http://evil.example')[0], 403)
        self.assertEqual(self.panel.get('/save.csv', **{'Sec-Fetch-Site': 'cross-site'})[0], 403)
        self.assertEqual(self.panel.get(Host=f'localhost:{self.panel.port}')[0], 200)
        for headers in ({'Origin': 'http://evil.example'}, {'Origin': 'null'},
                        {'Origin': f'http://localhost:{self.panel.port + 1}'},
                        {'Host': 'evil.example', 'Origin': 'http://evil.example'}):
            with self.assertRaises(tornado.httpclient.HTTPClientError) as caught:
                Socket(self.panel, **headers)
            self.assertEqual(caught.exception.code, 403)
        self.assertEqual(self.panel.get('/../scripts/panel')[0] // 100, 4)

    def test_what_is_no_address_is_a_bad_request(self):
        for origin in ('http://[bad', 'http://[::1', '//[x]'):
            self.assertEqual(self.panel.get(Origin=origin)[0], 400, origin)
        self.assertEqual(self.panel.get(Host='[bad')[0], 403)

    def test_a_column_is_asked_for_once(self):
        socket = Socket(self.panel)
        self.addCleanup(socket.close)
        for names in (['drive/angle'] * 60000, ['drive/angle', 'load/angle', 'drive/angle'],
                      [f'x{n}' for n in range(3000)], 'drive/angle', ['drive/angle', 1]):
            for field in ('columns', 'latest'):
                view = {'columns': [], 'latest': [], 'seconds': 60, field: names}
                socket.say(show=view)
                answer = socket.answer()
                self.assertFalse(answer['ok'])
                self.assertIn('columns: ', answer['text'])
                self.assertLess(len(answer['text']), 200)
        self.assertEqual(self.panel.get('/save.csv?columns=drive/angle,drive/angle')[0], 400)
        self.assertEqual(self.panel.get('/save.csv?columns=drive/angle')[0], 200)

    def test_it_waits_where_descriptors_run_out(self):
        panel = PanelProcess('--node', '/served')
        self.addCleanup(panel.close)
        # rospy's own server spins while it cannot accept a subscriber, so all of them come before.
        wait_for(lambda: panel.get('/save.csv?columns=drive/angle')[0] == 200, 'its scene')
        wait_for(panel.has_all_subscribers, 'subscribers of its topics')
        stat = pathlib.Path(f'/proc/{panel.process.pid}/stat')

        def busy():
            fields = stat.read_text().split()
            return (int(fields[13]) + int(fields[14])) / 100

        # Fewer than its own half: accepting fails. More: browsers have half of them.
        for more in (3, 100):
            with self.subTest(more=more):
                taken = len(list(pathlib.Path(f'/proc/{panel.process.pid}/fd').iterdir()))
                before = resource.prlimit(panel.process.pid, resource.RLIMIT_NOFILE)
                resource.prlimit(panel.process.pid, resource.RLIMIT_NOFILE, (taken + more, before[1]))
                strangers = [tcp.create_connection(('127.0.0.1', panel.port))
                             for _ in range(taken + more)]
                time.sleep(0.5)
                begin = busy()
                time.sleep(2.0)
                self.assertLess(busy() - begin, 0.5, 's of the processor in 2 s')
                for stranger in strangers:
                    stranger.close()
                resource.prlimit(panel.process.pid, resource.RLIMIT_NOFILE, before)
                self.assertEqual(panel.get()[0], 200)

    def test_a_node_that_was_killed_is_no_choice(self):
        """The master goes on listing it."""
        dead = Drivetrain('dead')
        wait_for(lambda: '/dead' in drivetrains(), 'a second node')
        dead.kill()
        self.assertIn('/dead/status', dict(rospy.get_master().getTopicTypes()[2]))
        self.assertEqual(drivetrains(), ['/served'])
        panel = PanelProcess()
        self.addCleanup(panel.close)
        self.assertEqual(panel.get()[0], 200)

    def test_a_token_is_asked_for(self):
        panel = PanelProcess('--node', '/served', '--token', 'secret')
        self.addCleanup(panel.close)
        self.assertTrue(panel.url.endswith('/?token=secret'))
        self.assertEqual(panel.get()[0], 403)
        self.assertEqual(panel.get('/?token=wrong')[0], 403)
        self.assertEqual(panel.get(Cookie=f'variator_sim_panel_{panel.port}=secret')[0], 200)
        self.assertEqual(panel.get('/save.csv')[0], 403)
        with self.assertRaises(tornado.httpclient.HTTPClientError):
            Socket(panel)
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(panel.url, timeout=PATIENCE) as answer:
            self.assertEqual(answer.url, panel.root + '/')
            self.assertIn(b'<title>', answer.read())

    def test_only_what_is_shown_is_subscribed_to(self):
        def subscribed():
            state = rospy.get_master().getSystemState()[2][1]
            return {topic.split('/')[-1] for topic, nodes in state if topic.startswith('/served/')
                    and any('panel' in node for node in nodes)} & {'state', 'elements', 'inputs', 'energy'}

        socket = Socket(self.panel)
        socket.say(show={'columns': ['drive/velocity'], 'latest': [], 'seconds': 10})
        socket.frames_until(lambda head, rows: rows is not None, 'rows')
        socket.frames_until(lambda head, rows: subscribed() == {'state'}, 'state alone')
        socket.say(show={'columns': [], 'latest': ['power/applied'], 'seconds': 10})
        socket.frames_until(lambda head, rows: 'power/applied' in head['latest'], 'power')
        wait_for(lambda: socket.frame() and subscribed() == {'energy'}, 'energy alone')
        # The input behind a slider is observed only while it can change.
        socket.say(show={'columns': [], 'latest': ['inputs/ratio'], 'seconds': 10})
        wait_for(lambda: socket.frame() and not subscribed(), 'inputs that rest')
        self.assertEqual(socket.frame()[0]['latest'], {'inputs/ratio': 0.5})
        socket.say(command={'topic': 'ratio', 'value': 0.6})
        socket.frames_until(lambda head, rows: head['latest'].get('inputs/ratio') == 0.6, 'ratio')
        socket.say(show={'columns': ['drive/velocity'], 'latest': [], 'seconds': 10})
        wait_for(lambda: socket.frame() and subscribed() == {'state'}, 'state')
        socket.close()
        wait_for(lambda: not subscribed(), 'no subscriptions')

    def test_what_is_shown_is_saved(self):
        socket = Socket(self.panel)
        self.addCleanup(socket.close)
        socket.frame()
        groups = {'inputs': 'inputs', 'outputs': 'outputs', 'element torque': 'elements',
                  'velocity': 'state', 'power': 'energy'}
        wait_for(lambda: socket.frame() and set(groups) <= {
            column['quantity'] for column in socket.scene['columns']}, 'the names of all columns')
        names = [next(column['name'] for column in socket.scene['columns']
                      if column['quantity'] == quantity) for quantity in groups]
        socket.say(show={'columns': names, 'latest': names, 'seconds': 1})
        socket.frames_until(lambda head, rows: rows is not None and len(head['latest']) == len(names)
                            and len(rows) > 50 and not numpy.isnan(rows[10:-10]).any(), 'values')
        head, _ = socket.frame()
        begin, end = head['newest'] - 0.2, head['newest'] - 0.1
        query = f'?columns={",".join(names)}&begin={begin}&end={end}'
        rows = list(csv.reader(io.StringIO(self.panel.get('/save.csv' + query)[1].decode())))
        self.assertEqual(rows[0], ['time'] + names)
        self.assertTrue(9 <= len(rows) - 1 <= 12, rows)
        self.assertTrue(all(begin <= float(row[0]) <= end for row in rows[1:]))
        with tempfile.NamedTemporaryFile(suffix='.bag') as file:
            file.write(self.panel.get('/save.bag' + query)[1])
            file.flush()
            with rosbag.Bag(file.name) as bag:
                found = {topic: message for topic, message, _ in bag.read_messages()}
                count = bag.get_message_count('/served/state')
        self.assertEqual(set(found), {f'/served/{topic}' for topic in
                                      (*groups.values(), 'scene', 'status')})
        self.assertEqual(count, len(rows) - 1)
        last = dict(zip(rows[0], map(float, rows[-1])))
        self.assertEqual(found['/served/state'].time, last['time'])
        self.assertEqual(found['/served/state'].velocity[0], last[names[3]])
        self.assertEqual(found['/served/energy'].kinetic,
                         float(found['/served/energy'].kinetic))
        inputs = found['/served/inputs']
        self.assertEqual(inputs.value[inputs.name.index(names[0].partition('/')[2])], last[names[0]])

    def test_commands_and_services(self):
        socket = Socket(self.panel)
        self.addCleanup(socket.close)
        # A failure leaves no pause to the tests after it.
        self.addCleanup(self.client.trigger, 'resume')
        socket.say(call='pause')
        self.client.wait_for_state(SimulationStatus.PAUSED)
        # In whole nanoseconds, as the node counts: sums of rounded seconds need not be equal.
        end = nanoseconds(self.client.status.all()[-1]) + 125000000
        socket.say(call='step', arguments={'duration': 0.125})
        self.client.status.wait(lambda status: nanoseconds(status) == end, 'the step')
        socket.say(call='step', arguments={'duration': -1})
        wait_for(lambda: not socket.answer()['ok'], 'a refusal')
        socket.say(call='resume')
        self.client.wait_for_state(SimulationStatus.RUNNING)
        socket.say(command={'topic': 'no_topic', 'value': 1})
        wait_for(lambda: 'no_topic' in socket.answer()['text'], 'a complaint')
        socket.say(call='set_parameters', arguments={'real_time_factor': 2.0})
        wait_for(lambda: socket.frame()[0]['settings'].get('real_time_factor') == 2.0, 'the factor')
        socket.say(call='set_parameters', arguments={'real_time_factor': 1.0})


@unittest.skipIf(find_browser() is None, 'no Chromium is installed')
class PageTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.node = Drivetrain('looked_at')
        cls.client = NodeClient('looked_at', states=False)
        cls.panel = PanelProcess('--node', '/looked_at')
        cls.page = Browser(cls.panel.root)

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        cls.panel.close()
        cls.client.close()
        cls.node.kill()

    def setUp(self):
        self.page.open(self.panel.root)
        self.wait_for_state('RUNNING')

    def tearDown(self):
        self.assertEqual(self.page.complaints, [])

    def wait_for_state(self, name):
        self.page.wait(f'document.querySelector("#state").textContent == "{name}"', name)

    def picture(self, index=0):
        """A digest of the pixels of a plot's curves."""
        return self.page.run(f'document.querySelectorAll(".curve canvas")[{index}].toDataURL()')

    def test_plots_move_and_pause_stops_them(self):
        page = self.page
        page.wait('document.querySelectorAll(".curve canvas").length >= 8', 'four plots')
        first = self.picture()
        page.wait(f'document.querySelector(".curve canvas").toDataURL() != {json.dumps(first)}',
                  'a curve that moves')
        page.click('#pause')
        self.wait_for_state('PAUSED')
        self.client.wait_for_state(SimulationStatus.PAUSED)
        page.wait('!document.querySelector("#step").disabled', 'the step button')
        # Two heartbeats later nothing has moved.
        page.run('new Promise((done) => setTimeout(done, 600))')
        stopped, time_shown = self.picture(), page.text('#time')
        page.run('new Promise((done) => setTimeout(done, 600))')
        self.assertEqual(self.picture(), stopped)
        self.assertEqual(page.text('#time'), time_shown)
        page.click('#step')
        page.wait(f'Number(document.querySelector("#time").textContent) > {time_shown}', 'a step')
        page.click('#resume')
        self.wait_for_state('RUNNING')
        page.wait(f'document.querySelector(".curve canvas").toDataURL() != {json.dumps(stopped)}',
                  'a curve that moves on')

    def test_plots_fit_their_places(self):
        page = self.page
        page.wait('document.querySelectorAll(".curve canvas").length >= 8', 'four plots')
        page.run('(() => { const add = document.querySelector("#add"); add.value = "angle"; '
                 'add.dispatchEvent(new Event("change")); })()')
        page.wait('document.querySelectorAll(".plot").length == 5 && '
                  '[...document.querySelectorAll(".curve")].every((curve) => { '
                  'const canvas = curve.querySelector("canvas"); '
                  'return canvas && canvas.clientHeight == curve.clientHeight; })',
                  'five plots of one size')
        for _ in range(5):
            page.click('.plot .tools button:last-child')
        page.wait('document.querySelectorAll(".plot").length == 0', 'no plots')
        page.run('localStorage.clear()')

    def test_thirty_frames_a_second_at_most(self):
        count = 'Number(document.body.dataset.frames || 0)'
        self.page.wait(count + ' > 5', 'frames')
        before, begin = self.page.run(count), time.monotonic()
        self.page.run('new Promise((done) => setTimeout(done, 1000))')
        frames = self.page.run(count) - before
        self.assertLessEqual(frames, 31 * (time.monotonic() - begin) + 1)
        self.assertGreater(frames, 3)  # a busy machine still moves

    def test_a_slider_moves_the_motion(self):
        page = self.page
        box = page.wait('(() => { const s = document.querySelector(".input input[type=range]"); '
                        'if (!s) return null; const b = s.getBoundingClientRect(); '
                        'return [b.x, b.y + b.height / 2, b.width, s.value, s.min, s.max]; })()',
                        'a slider')
        x, y, width, value = *box[:3], float(box[3])
        low, high = float(box[4]), float(box[5])
        share = (value - low) / (high - low)
        page.drag(x + 8 + share * (width - 16), y, x + 0.8 * width, y)
        topic = page.text('.input .name b')
        wanted = float(page.run('document.querySelector(".input input[type=range]").value'))
        self.assertGreater(wanted, value)
        self.client.status.wait(lambda status: status.commands_accepted > 0, 'the command')
        page.wait('(() => { const f = parseFloat(document.querySelector(".force").textContent'
                  f'.replace("in force ", "")); return Math.abs(f - {wanted}) < 1e-3 * '
                  f'Math.max(1, {abs(wanted)}); }})()', f'the new {topic} in force')

    def test_powers_tell_their_time(self):
        """Of a simulation that stands they may be as old as the last look at them."""
        page = self.page
        old = 'document.querySelector("#flow-old").textContent'
        page.wait('document.querySelectorAll(".curve canvas").length >= 8', 'four plots')
        page.wait('Number(document.querySelector("#time").textContent) > 1.0', 'time that goes on')
        page.run('new Promise((done) => setTimeout(done, 1500))')
        page.click('#pause')
        self.addCleanup(self.client.trigger, 'resume')
        self.wait_for_state('PAUSED')
        page.click('[data-view=energy]')
        page.wait(f'{old}.includes("Not the state of now")', 'a word of their age')
        stands, shown = float(page.text('#time')), float(page.text('#flow-time').split()[0])
        self.assertLess(shown, stands - 1.0)
        self.assertIn(f'{stands:.3f} s', page.text('#flow-old'))
        page.click('#step')
        page.wait(f'{old} === "" && Math.abs(parseFloat(document.querySelector("#flow-time").textContent) '
                  '- Number(document.querySelector("#time").textContent)) < 1e-9', 'the powers of the step')

    def test_many_shafts_and_inputs_have_room(self):
        node = Drivetrain('wide', many_shafts())
        self.addCleanup(node.kill)
        panel = PanelProcess('--node', '/wide')
        self.addCleanup(panel.close)
        page = self.page
        page.open(panel.root)
        self.addCleanup(page.open, self.panel.root)  # before its panel ends
        page.wait('document.querySelectorAll(".curve canvas").length >= 8', 'four plots')
        self.assertIn('and 55 more', page.text('.legend'))
        page.wait('[...document.querySelectorAll(".plot")].every((plot) => 2 * plot.querySelector(".curve").clientHeight '
                  '> plot.clientHeight)', 'curves in half of their plots')
        page.wait('document.querySelector(".input input[type=number]").value === "5"', 'the value of the first input')
        page.click('[data-view=energy]')
        page.wait('document.querySelectorAll("#flow .watt").length === 18', 'nine bars on each side')
        overlaps = page.run('(() => { const boxes = [...document.querySelectorAll("#flow text")].map((text) => '
                            'text.getBBox()); return boxes.filter((a, i) => boxes.some((b, k) => k < i && a.x < b.x + '
                            'b.width && b.x < a.x + a.width && a.y + 4 < b.y + b.height && b.y + 4 < a.y + a.height))'
                            '.length; })()')
        self.assertEqual(overlaps, 0)

    def test_death_and_return_of_the_node_are_shown(self):
        page = self.page
        page.wait('document.querySelectorAll(".curve canvas").length >= 8', 'four plots')
        self.node.kill()
        self.wait_for_state('NO NODE')
        self.assertIn('silent', page.text('#stop'))
        self.assertTrue(page.run('document.querySelector("#pause").disabled'))
        self.node.start()
        self.wait_for_state('RUNNING')
        page.wait('Number(document.querySelector("#time").textContent) > 0.2', 'time that goes on')
        frames = page.run('Number(document.body.dataset.frames)')
        page.wait(f'Number(document.body.dataset.frames) > {frames} + 10', 'curves of the new one')

    def test_other_views_and_saved_files(self):
        page = self.page
        page.click('[data-view=scene]')
        page.wait('document.querySelector("#equations").textContent.includes("equations of motion")',
                  'the equations')
        self.assertIn('shafts', page.text('#parameters'))
        page.click('[data-view=energy]')
        page.wait('document.querySelector("#flow").children.length > 0', 'the flow of energy')
        page.wait('/\\d/.test(document.querySelector("#account").textContent)', 'an account')
        page.click('[data-view=plots]')
        page.click('#hold')
        for kind, start in (('csv', b'time,'), ('bag', b'#ROSBAG'), ('png', b'\x89PNG')):
            page.click('#save-' + kind)
            path = page.downloads / f'looked_at.{kind}'
            wait_for(path.exists, path.name)
            wait_for(lambda path=path: path.read_bytes()[:len(start)] == start, path.name)


class PanelSuite(unittest.TestSuite):
    """All of the above, for rostest."""

    def __init__(self):
        super().__init__(unittest.defaultTestLoader.loadTestsFromTestCase(case)
                         for case in (TableTest, GuardTest, AcceptTest, ServerTest, PageTest))


if __name__ == '__main__':
    rospy.init_node('panel_test')
    rostest.rosrun('variator_sim', 'panel_test', 'panel_test.PanelSuite', sys.argv)
