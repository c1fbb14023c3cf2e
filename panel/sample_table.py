"""The samples of a drivetrain: a row per instant, a column per quantity, NaN without a value."""

import math
import threading

import numpy

FIRST_ROWS = 4096


class SampleTable:
    """Grows up to a size in bytes, then forgets the oldest quarter. Safe to use from threads."""

    def __init__(self, limit=64e6):
        self._limit = limit
        self._lock = threading.Lock()
        self._names = {}   # column: index
        self._groups = {}  # group: slice of columns
        self.version = 0   # changes with every row
        self._forget()

    def _forget(self):
        self._rows = 0
        self._stamps = numpy.zeros(FIRST_ROWS, numpy.int64)  # ns, ROS time
        self._times = numpy.zeros(FIRST_ROWS)                # s, simulated
        self._values = numpy.full((FIRST_ROWS, len(self._names)), numpy.nan)
        self._next = dict.fromkeys(self._groups, 0)          # behind the last row that a group filled
        self._last_time = {}                                 # of a group, s
        self._newest = {}                                    # of a group: its last values, and their time
        self.version += 1

    def add_group(self, group, names):
        """`names`: the columns of a group, in the order in which `put` will bring them."""
        with self._lock:
            if group in self._groups:
                return
            first = len(self._names)
            self._names.update({name: first + i for i, name in enumerate(names)})
            self._groups[group] = slice(first, first + len(names))
            self._next[group] = 0
            room = numpy.full((len(self._values), len(names)), numpy.nan)
            self._values = numpy.hstack([self._values, room])

    def put(self, group, stamp, time, values):
        """One message of a group. A group whose time jumps back begins a new table."""
        with self._lock:
            if time < self._last_time.get(group, time):
                self._forget()
            row = self._find_row(group, stamp, time)
            if row is None:
                return
            self._values[row, self._groups[group]] = values
            self._next[group] = row + 1
            self._last_time[group] = time
            self._newest[group] = values, time
            self.version += 1

    def _find_row(self, group, stamp, time):
        """The row of an instant, a new one where none has it yet; None when it is past."""
        for row in range(self._next[group], self._rows):
            if self._times[row] == time and self._stamps[row] == stamp:
                return row
        if self._rows and time < self._times[self._rows - 1]:
            return None  # came before the other groups were subscribed to
        if self._rows == len(self._times):
            self._make_room()
        row = self._rows
        self._stamps[row], self._times[row], self._values[row] = stamp, time, numpy.nan
        self._rows += 1
        return row

    def _make_room(self):
        if 2 * self._values.nbytes <= self._limit:
            for name in ("_stamps", "_times", "_values"):
                old = getattr(self, name)
                setattr(self, name, numpy.concatenate([old, numpy.empty_like(old)]))
            return
        gone = self._rows // 4
        for array in (self._stamps, self._times, self._values):
            array[:-gone] = array[gone:].copy()
        self._rows -= gone
        self._next = {group: max(0, row - gone) for group, row in self._next.items()}

    def knows(self, group):
        return group in self._groups

    def latest(self, columns):
        """The last value of each column that has one."""
        with self._lock:
            found = {}
            for group, (values, _) in self._newest.items():
                first = self._groups[group].start
                for name in columns:
                    place = self._names.get(name, -1) - first
                    if 0 <= place < len(values) and math.isfinite(values[place]):
                        found[name] = values[place]
            return found

    def latest_times(self):
        """Group: the time of its last values, s. Groups come while they are shown, so some may be old."""
        with self._lock:
            return {group: time for group, (_, time) in self._newest.items()}

    def window(self, columns, begin=-numpy.inf, end=numpy.inf):
        """(stamps, times, values) of the columns for begin <= time <= end; values row by row."""
        with self._lock:
            times = self._times[:self._rows]
            rows = slice(numpy.searchsorted(times, begin, "left"),
                         numpy.searchsorted(times, end, "right"))
            picked = [self._names[name] for name in columns]
            return (self._stamps[rows].copy(), times[rows].copy(), self._values[rows][:, picked])

    def groups(self):
        """Group: its columns in their order."""
        with self._lock:
            names = list(self._names)
            return {group: names[columns] for group, columns in self._groups.items()}

    def newest_time(self):
        """s; None without rows."""
        with self._lock:
            return float(self._times[self._rows - 1]) if self._rows else None


def decimate(times, values, width):
    """At most two rows per interval [i width, (i+1) width): for each column its least and its
    greatest value there, in the order in which the curve goes, so that no peak is lost. Intervals
    stand still while time goes on: a curve does not flicker."""
    bucket = numpy.floor(times / width)
    starts = numpy.flatnonzero(numpy.diff(bucket, prepend=-numpy.inf))
    if 2 * len(starts) >= len(times):
        return times, values
    ends = numpy.append(starts[1:], len(times)) - 1
    least = numpy.fmin.reduceat(values, starts, axis=0)
    greatest = numpy.fmax.reduceat(values, starts, axis=0)
    rises = values[ends] >= values[starts]
    few_times = numpy.empty(2 * len(starts))
    few_times[0::2], few_times[1::2] = times[starts], times[ends]
    few = numpy.empty((2 * len(starts), values.shape[1]))
    few[0::2] = numpy.where(rises, least, greatest)
    few[1::2] = numpy.where(rises, greatest, least)
    return few_times, few
