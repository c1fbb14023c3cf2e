"""Curves in the plane of a pulley: points (x, z), counterclockwise as positive shafts turn."""

import math

FEWEST, MOST = 0.12, 8.0  # speed ratios beyond are drawn as these


def pulley_radii(ratio, total):
    """Radii of two pulleys joined by a belt: ratio = w_b/w_a = r_a/r_b, r_a + r_b = total."""
    ratio = min(max(abs(ratio), FEWEST), MOST)
    return total * ratio / (1.0 + ratio), total / (1.0 + ratio)


def arc(centre, radius, begin, end, steps):
    """steps + 1 points from one angle (rad) to another."""
    return [(centre[0] + radius * math.cos(begin + (end - begin) * i / steps),
             centre[1] + radius * math.sin(begin + (end - begin) * i / steps))
            for i in range(steps + 1)]


def belt(x_a, r_a, x_b, r_b, crossed):
    """A closed belt about (x_a, 0) and (x_b, 0), x_a < x_b; crossed, the pulleys turn oppositely.
    It begins with the first pulley, counterclockwise."""
    sum_or_difference = r_a + r_b if crossed else r_a - r_b
    touch = math.acos(sum_or_difference / (x_b - x_a))
    points = arc((x_a, 0.0), r_a, touch, 2.0 * math.pi - touch, 24)
    begin = math.pi - touch if crossed else -touch
    points += arc((x_b, 0.0), r_b, begin, -begin, 24)
    return points + points[:1]


def along(points, step, offset):
    """Points every `step` along a polyline, the first at `offset` modulo `step`, m."""
    found = []
    ahead = offset % step
    for (x0, z0), (x1, z1) in zip(points, points[1:]):
        length = math.hypot(x1 - x0, z1 - z0)
        while ahead <= length and length > 0.0:
            share = ahead / length
            found.append((x0 + share * (x1 - x0), z0 + share * (z1 - z0)))
            ahead += step
        ahead -= length
    return found


def torque_arrow(centre, radius, sweep):
    """An arrow about an axis, from the top by `sweep` rad: the line, the two ends of its head; two
    empty lists where it is too short to be seen."""
    if abs(sweep) < 0.02:
        return [], []
    top, tip = 0.5 * math.pi, 0.5 * math.pi + sweep
    neck = tip - math.copysign(min(0.3, abs(sweep)), sweep)
    line = arc(centre, radius, top, neck, max(2, int(16 * abs(sweep))))
    return line, arc(centre, radius, neck, tip, 1)
