#!/usr/bin/env python3
"""Ceiling radiosity of cases/ward_room by Mitsuba 3's `path`, each value with its standard error.

    pip install mitsuba==3.9.1
    bench/ward/reference.py [--error 0.002] [--room NAME] [--processes N]

A `radiancemeter` looks straight up at each point, so that `path` estimates the radiance B/pi that leaves it. Lamps are
reached by next-event estimation, and by way of a mirror by hitting them: one path in some hundreds does, with a weight
as large. That is no bias, and what it adds to the variance is in the standard error, which is taken over passes with
seeds of their own. Passes are added until the error asked for is met. Prints the table of cases/ward_room/ceiling.csv.
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
# Paths a pass: enough for a mean to be a normal variable.
PATHS = 1 << 18
# Passes at a time, and before an error is believed.
PASSES = 32

# Of each process: the scenes that it has read.
scenes = {}


def one_pass(job):
    """The mean of some paths [W/m²]."""
    room, x, y, number = job
    if room not in scenes:
        scenes[room] = mi.load_file(str(SCENE), **{wall: "mirror" for wall in ROOMS[room]})
    sensor = mi.load_dict({
        "type": "radiancemeter",
        "origin": [x, y, 2.0],
        "direction": [0, 0, 1],
        "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": PATHS},
    })
    # Seeds differ from pass to pass and from point to point.
    seed = int(1000 * x) * 100_003 + int(1000 * y) * 1_009 + number
    image = mi.render(scenes[room], sensor=sensor, spp=PATHS, seed=seed)
    return math.pi * float(image.array[1])


def radiosity(pool, room, point, error, most):
    """Mean and standard error of the radiosity of the ceiling [W/m²], and passes."""
    passes = []
    while True:
        n = len(passes)
        passes += pool.map(one_pass, [(room, *point, n + k) for k in range(PASSES)], 1)
        n = len(passes)
        mean = math.fsum(passes) / n
        deviation = math.sqrt(math.fsum((p - mean) ** 2 for p in passes) / (n - 1) / n)
        if deviation <= error * mean or n >= most:
            return mean, deviation, n


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--error", type=float, default=0.002, help="standard error, relative")
    parser.add_argument("--most", type=int, default=4000, help="most passes a point")
    parser.add_argument("--room", choices=list(ROOMS), help="this one alone")
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
                mean, deviation, n = radiosity(pool, room, point, arguments.error, arguments.most)
                x, y = point
                print(f"{room},{x},{y},{mean:.6f},{deviation:.6f},{n * PATHS}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
