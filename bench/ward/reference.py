#!/usr/bin/env python3
"""Ceiling radiosity of cases/ward_room by Mitsuba 3's `path`, each value with its standard error.

    pip install mitsuba==3.9.1
    bench/ward/reference.py [--error 0.0015] [--room NAME] [--processes N] [--method path]

A `radiancemeter` looks straight up at each point, so that the integrator estimates the radiance B/pi that leaves it.
Passes with seeds of their own are added until their standard error is what was asked for. Two methods:

- `path`: the scene as it is. Behind a mirror lamps are found by hitting them alone: one path in some hundreds does,
  with a weight as large, and 0.3 % takes ten to forty million paths a point.
- `unfolded`: what a mirror shows is built behind it, and the mirror is a filter that lets 0.75 of the light through
  (`mask`), which next-event estimation of `volpath` sees lamps through. Of facing mirrors five rooms in a row are built,
  and mirrors close the row: exact as well, as light that returns from them is what a sixth room would send. Thirty
  times fewer paths; the same values as `path`, to the errors of both.

Prints the table of cases/ward_room/ceiling.csv.
"""
import argparse
import math
import multiprocessing
import os
import pathlib
import sys

import mitsuba as mi

ROOMS = {
    "none": [],
    "one": ["west"],
    "adjacent": ["west", "south"],
    "facing": ["south", "north"],
}
POINTS = [(0.25, 0.25), (0.75, 0.75), (1.25, 1.25), (1.75, 0.25), (1.25, 2.75)]
SCENE = pathlib.Path(__file__).resolve().parents[2] / "cases/ward_room/scene.xml"
# Paths a pass: enough for a mean to be nearly normal.
PATHS = 1 << 15
# Passes at a time, and before an error is believed: rare paths weigh much, and an error taken too early is too small.
PASSES = 64

# Of each process: the scenes that it has made.
scenes = {}


def rectangle(centre, half, normal, bsdf, radiance=0.0):
    """A rectangle across an axis: `half` are its half sides [m] along the two others, `normal` is +-1, +-2 or +-3."""
    to, axis = mi.ScalarTransform4f, abs(normal)
    # (x, y) of the rectangle's own frame come to lie along the other axes, in some order and sense.
    turn = {1: ([0, 1, 0], 90), -1: ([0, 1, 0], -90), 2: ([1, 0, 0], -90), -2: ([1, 0, 0], 90),
            3: ([1, 0, 0], 0), -3: ([1, 0, 0], 180)}[normal]
    u, v = {1: (half[1], half[0]), 2: half, 3: half}[axis]
    shape = {
        "type": "rectangle",
        "to_world": to().translate(centre).rotate(*turn).scale([u, v, 1]),
        "bsdf": bsdf,
    }
    if radiance:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
    return shape


def unfolded(room):
    """The scene with what its mirrors show behind them, and filters in their place."""
    mirrors = ROOMS[room]
    rows = {"x": [0], "y": [0]}
    for axis, low, high in (("x", "west", "east"), ("y", "south", "north")):
        if low in mirrors:
            rows[axis] = [-2, -1, 0, 1, 2] if high in mirrors else [-1, 0]
    paint = lambda value: {"type": "diffuse", "reflectance": {"type": "rgb", "value": value}}
    mirror = {"type": "conductor", "material": "none",
              "specular_reflectance": {"type": "rgb", "value": 0.75}}
    through = {"type": "mask", "opacity": 0.25, "bsdf": {"type": "twosided", "bsdf": paint(0.0)}}
    shapes = []
    for i in rows["x"]:
        for j in rows["y"]:
            x, y = 10.0 * i, 6.0 * j
            shapes += [
                rectangle([x + 5, y + 3, 0], (5, 3), 3, paint(0.3)),
                rectangle([x + 2.375, y + 3, 3], (2.375, 3), -3, paint(0.7)),
                rectangle([x + 7.625, y + 3, 3], (2.375, 3), -3, paint(0.7)),
                rectangle([x + 5, y + 1.375, 3], (0.25, 1.375), -3, paint(0.7)),
                rectangle([x + 5, y + 4.625, 3], (0.25, 1.375), -3, paint(0.7)),
                rectangle([x + 5, y + 3, 3], (0.25, 0.25), -3, paint(0.0), 10.0),
            ]
            for axis, k, at, half, step in (
                (1, i, lambda e: [x + e, y + 3, 1.5], (3, 1.5), 10.0),
                (2, j, lambda e: [x + 5, y + e, 1.5], (5, 1.5), 6.0),
            ):
                row = rows["x" if axis == 1 else "y"]
                end = mirror if len(row) == 5 else paint(0.5)
                if k == row[0]:
                    shapes.append(rectangle(at(0.0), half, axis, end))
                if k == row[-1]:
                    shapes.append(rectangle(at(step), half, -axis, end))
                else:
                    shapes.append(rectangle(at(step), half, -axis, through))
    return mi.load_dict({"type": "scene", "integrator": {"type": "volpath"}}
                        | {f"shape_{n}": shape for n, shape in enumerate(shapes)})


def one_pass(job):
    """The mean of some paths [W/m²]."""
    method, room, x, y, number = job
    if (method, room) not in scenes:
        made = unfolded(room) if method == "unfolded" else mi.load_file(
            str(SCENE), **{wall: "mirror" for wall in ROOMS[room]})
        scenes[method, room] = made
    sensor = mi.load_dict({
        "type": "radiancemeter",
        "origin": [x, y, 2.0],
        "direction": [0, 0, 1],
        "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": PATHS},
    })
    # Seeds differ from pass to pass and from point to point.
    seed = int(1000 * x) * 100_003 + int(1000 * y) * 1_009 + number
    image = mi.render(scenes[method, room], sensor=sensor, spp=PATHS, seed=seed)
    return math.pi * float(image.array[1])


def radiosity(pool, method, room, point, error, most):
    """Mean and standard error of the radiosity of the ceiling [W/m²], and passes."""
    passes = []
    while True:
        n = len(passes)
        passes += pool.map(one_pass, [(method, room, *point, n + k) for k in range(PASSES)], 1)
        n = len(passes)
        mean = math.fsum(passes) / n
        deviation = math.sqrt(math.fsum((p - mean) ** 2 for p in passes) / (n - 1) / n)
        if deviation <= error * mean or n >= most:
            return mean, deviation, n


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--error", type=float, default=0.0015, help="standard error, relative")
    parser.add_argument("--most", type=int, default=4000, help="most passes a point")
    parser.add_argument("--room", choices=list(ROOMS), help="this one alone")
    parser.add_argument("--method", choices=["unfolded", "path"], default="unfolded")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    mi.set_variant("scalar_rgb")
    print("room,x,y,radiosity,standard_error,paths")
    # A picture of one pixel is the work of one thread.
    with multiprocessing.Pool(arguments.processes) as pool:
        for room in ROOMS:
            if arguments.room not in (None, room):
                continue
            for point in POINTS:
                mean, deviation, n = radiosity(pool, arguments.method, room, point, arguments.error,
                                               arguments.most)
                x, y = point
                print(f"{room},{x},{y},{mean:.6f},{deviation:.6f},{n * PATHS}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
