#!/usr/bin/env python3
"""Compares a picture of evolute's with the same scene in Mitsuba 3, and says what each of them took.

    bench/room/compare.py [SCENE] [--size 160x120] [--budget 600] [-o FOLDER]

Without SCENE: the built-in room. What is compared, and how noise is kept out of the figures, is told in
bench/README.md. Needs Python 3.9, Mitsuba 3 and NumPy (`pip install mitsuba numpy`), for Mitsuba's `llvm`
variants the LLVM library (Debian: libllvm19; DRJIT_LIBLLVM_PATH names the file if it is not found), and the
program, `cargo build --release`. Installs nothing.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/evolute"
ROOM = ROOT / "cases/room/scene.xml"

try:
    import numpy as np
    import mitsuba as mi
except ImportError as missing:
    sys.exit(f"{missing.name} is missing: pip install mitsuba numpy")

# Rays through a pixel in each direction that say what it shows.
PROBES = 5
# Surfaces that reflect so little pass on no light that matters: what they show came straight from mirrors and lamps.
FAINT = 1e-3
# Pixels around a silhouette of something that is not diffuse that are left out.
MARGIN = 1


def main():
    arguments = parse()
    folder = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    mi.set_variant(arguments.variant)
    ours_scene, plain = prepare(arguments, folder)
    scene = mi.load_file(str(plain), optimize=False)

    print(f"Mitsuba {mi.__version__} ({arguments.variant}), {arguments.width} x {arguments.height}, box filter")
    seen, whole = diffuse_pixels(scene, arguments.width, arguments.height)
    print(f"diffuse pixels: {seen.sum()} of {seen.size}")
    ours, seconds = render_ours(arguments, ours_scene, folder)
    batches, theirs = render_batches(arguments, scene, folder)

    report(arguments, ours, seconds, batches, theirs, seen, whole)
    if arguments.path > 0:
        third_opinion(arguments, scene, ours, batches, seen)


def parse():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", nargs="?", type=Path, default=ROOM, help="Mitsuba 3 XML, with `parametric` shapes or not")
    p.add_argument("-o", "--output", type=Path, default=Path("compare"), metavar="FOLDER")
    p.add_argument("--size", default="160x120", metavar="WxH")
    p.add_argument("--budget", type=float, default=600, metavar="S", help="processor seconds for ptracer")
    p.add_argument("--batches", type=int, default=8, help="independent pictures that the budget is divided into")
    p.add_argument("--samples", type=int, default=256, help="light paths a pixel in one call of ptracer")
    p.add_argument("--light", choices=["total", "lamps", "direct"], default="total",
                   help="what is compared: all light; without what diffuse surfaces pass on; straight from lamps only")
    p.add_argument("--triangles", type=int, default=500_000, help="fewest triangles of a mesh in place of formulas")
    p.add_argument("--accuracy", "-a", default="0.01", help="evolute's")
    p.add_argument("--path", type=int, default=0, metavar="N", help="a third opinion: `path` with N samples a pixel")
    p.add_argument("--variant", default="llvm_ad_rgb")
    p.add_argument("--reuse", action="store_true", help="take pictures that are in the folder already")
    p.add_argument("-D", dest="define", action="append", default=[], metavar="NAME=VALUE")
    arguments = p.parse_args()
    arguments.width, arguments.height = (int(n) for n in arguments.size.split("x"))
    if arguments.batches < 2:
        p.error("--batches: noise is told from a difference by two or more")
    if not PROGRAM.exists():
        sys.exit(f"{PROGRAM} is missing: cargo build --release")
    return arguments


# Scenes


def prepare(arguments, folder):
    """The scene for either program, with the same camera, film and filter: paths of the two files."""
    command = [PROGRAM, "export", arguments.scene, "-o", folder / "plain", "--json", "-q",
               "--triangles", str(arguments.triangles)]
    command += [f"-D{d}" for d in arguments.define]
    made = subprocess.run(command, check=True, capture_output=True, text=True)
    exported = Path(json.loads(made.stdout.splitlines()[-1])["files"][-1])

    tree = ElementTree.parse(exported)
    root = tree.getroot()
    sensors = root.findall("sensor")
    if not sensors:
        sys.exit(f"{arguments.scene} has no sensor")
    for other in sensors[1:]:
        root.remove(other)
    for integrator in root.findall("integrator"):
        root.remove(integrator)
        limit = integrator.find("integer[@name='max_depth']")
        if limit is not None and int(limit.get("value")) >= 0:
            print("note: the scene's max_depth limits chains of mirrors in evolute, and nothing in ptracer")
    film = sensors[0].find("film")
    if film is None:
        film = ElementTree.SubElement(sensors[0], "film", type="hdrfilm")
    for child in list(film):
        film.remove(child)
    ElementTree.SubElement(film, "integer", name="width", value=str(arguments.width))
    ElementTree.SubElement(film, "integer", name="height", value=str(arguments.height))
    ElementTree.SubElement(film, "rfilter", type="box")
    if arguments.light == "lamps":
        for bsdf in root.iter("bsdf"):
            if bsdf.get("type") == "diffuse":
                darken(bsdf)
    plain = exported.with_name("compared.xml")
    tree.write(plain)

    # Ours is of the formulas themselves. Pictures are of the first sensor.
    own = ElementTree.Element("scene", version="3.0.0")
    own.append(sensors[0])
    ElementTree.SubElement(own, "include", filename=str(arguments.scene.resolve()))
    ours = folder / "ours.xml"
    ElementTree.ElementTree(own).write(ours)
    return ours, plain


def darken(bsdf):
    """Multiplies a diffuse surface's reflectance by FAINT."""
    reflectance = next((child for child in bsdf if child.get("name") == "reflectance"), None)
    if reflectance is None:
        ElementTree.SubElement(bsdf, "rgb", name="reflectance", value=str(0.5 * FAINT))
        return
    # Numbers, or pairs of a wavelength and a number.
    parts = [part.split(":") for part in reflectance.get("value").replace(",", " ").split()]
    parts = [":".join(part[:-1] + [repr(float(part[-1]) * FAINT)]) for part in parts]
    reflectance.set("value", ", ".join(parts))


def diffuse_pixels(scene, width, height):
    """Pixels that show diffuse surfaces and nothing else, nor do their neighbours; and pixels that show one face of
    one shape only.

    Light tracing cannot join a mirror, glass, or a lamp's own light to the camera."""
    import drjit as dr

    n = PROBES
    index = dr.arange(mi.UInt32, width * height * n * n)
    pixel, sub = index // (n * n), index % (n * n)
    # Both ends included, so that a silhouette on the border of a pixel counts for both.
    x = (mi.Float(pixel % width) + mi.Float(sub % n) / (n - 1)) / width
    y = (mi.Float(pixel // width) + mi.Float(sub // n) / (n - 1)) / height
    ray, _ = scene.sensors()[0].sample_ray(0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5, 0.5))
    hit = scene.ray_intersect(ray)
    flags = hit.bsdf().flags()
    delta = (flags & int(mi.BSDFFlags.Delta)) != 0
    lamp = hit.shape.is_emitter()
    plain = hit.is_valid() & ~delta & ~lamp
    shape = np.array(dr.reinterpret_array(mi.UInt32, hit.shape)).reshape(height, width, n * n)
    normal = np.array(hit.n).T.reshape(height, width, n * n, 3)
    # Two faces of a cube are at a right angle; a ball's normals do not turn so far within a pixel but at its limb.
    whole = (shape == shape[..., :1]).all(axis=2)
    whole &= ((normal * normal[..., :1, :]).sum(axis=3) > 0.5).all(axis=2)
    plain = np.array(plain).reshape(height, width, n * n).all(axis=2)
    out = plain.copy()
    padded = np.pad(plain, MARGIN, constant_values=True)
    for dy in range(2 * MARGIN + 1):
        for dx in range(2 * MARGIN + 1):
            out &= padded[dy:dy + height, dx:dx + width]
    return out, whole


# Pictures


def processor_seconds(who):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def render_ours(arguments, scene, folder):
    """Our layers, and processor seconds of the whole program."""
    picture, told = folder / "ours.exr", folder / "ours.json"
    if not (arguments.reuse and picture.exists() and told.exists()):
        command = [PROGRAM, "render", scene, "-o", picture, "--json", "-a", arguments.accuracy]
        command += [f"-D{d}" for d in arguments.define]
        before = processor_seconds(resource.RUSAGE_CHILDREN)
        made = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        seconds = processor_seconds(resource.RUSAGE_CHILDREN) - before
        facts = json.loads(made.stdout.splitlines()[-1])
        facts["processor_seconds"] = seconds
        told.write_text(json.dumps(facts, indent=1))
    facts = json.loads(told.read_text())
    bitmap = mi.Bitmap(str(picture))
    names = [field.name for field in bitmap.struct_()]
    data = np.array(bitmap, dtype=np.float64)
    layers = {}
    for layer in ["", "direct", "specular", "indirect", "emitted"]:
        prefix = layer + "." if layer else ""
        layers[layer or "sum"] = data[..., [names.index(prefix + c) for c in "RGB"]]
    wanted = {"total": ["sum"], "lamps": ["direct", "specular"], "direct": ["direct"]}[arguments.light]
    layers["compared"] = sum(layers[name] for name in wanted)
    return layers, facts["processor_seconds"]


def depth(arguments):
    """Mitsuba's `max_depth`: two edges are lamp, surface, camera."""
    return 2 if arguments.light == "direct" else -1


def render_batches(arguments, scene, folder):
    """Independent pictures of ptracer's, and processor seconds of all of them."""
    saved = folder / "ptracer.npz"
    if arguments.reuse and saved.exists():
        data = np.load(saved)
        return data["batches"], {"seconds": float(data["seconds"]), "samples": int(data["samples"])}
    integrator = mi.load_dict({"type": "ptracer", "max_depth": depth(arguments)})
    scale = 1 / FAINT if arguments.light == "lamps" else 1.0
    seed = 0

    def call(samples):
        nonlocal seed
        seed += 1
        picture = mi.render(scene, integrator=integrator, spp=samples, seed=seed)
        return scale * np.array(picture, dtype=np.float64)[..., :3]

    # The first call compiles; it is not counted.
    call(arguments.samples)
    start = processor_seconds(resource.RUSAGE_SELF)
    sums, calls = np.zeros((arguments.batches, arguments.height, arguments.width, 3)), 0
    spent = 0.0
    while calls == 0 or spent * (calls + 1) / calls <= arguments.budget:
        for batch in range(arguments.batches):
            sums[batch] += call(arguments.samples)
        calls += 1
        spent = processor_seconds(resource.RUSAGE_SELF) - start
        batches, samples = sums / calls, calls * arguments.batches * arguments.samples
        # Renamed into place: a run that is ended while it writes leaves what was there.
        part = folder / "part.npz"
        np.savez_compressed(part, batches=batches, seconds=spent, samples=samples)
        part.replace(saved)
    return batches, {"seconds": spent, "samples": samples}


# Figures


def pair_products(a, batches):
    """What estimates (a - m)² without noise at each pixel: the mean of (a - m1)(a - m2) over all pairs of
    independent pictures m1, m2 of the same mean m."""
    differences = a - batches
    k = len(batches)
    return (differences.sum(axis=0) ** 2 - (differences ** 2).sum(axis=0)) / (k * (k - 1))


def figures(a, batches, where):
    """Relative RMSE of `a` against the batches' mean over some pixels, with noise taken out, its standard error,
    the RMSE with noise in it, and the noise of the mean, all relative to the mean radiance there."""
    if not where.any():
        return None
    m = batches.mean(axis=0)
    mean = m[where].mean()
    products = pair_products(a, batches).mean(axis=2)
    square = products[where].mean()
    # Standard error by blocks of pixels: what one light path adds is spread over few of them.
    blocks = block_sums(np.where(where, products, 0.0))
    counts = block_sums(where.astype(float))
    blocks, counts = blocks[counts > 0], counts[counts > 0]
    spread = blocks - square * counts
    error = np.sqrt((spread ** 2).sum() * len(blocks) / max(len(blocks) - 1, 1)) / counts.sum()
    noise = (batches.var(axis=0, ddof=1) / len(batches)).mean(axis=2)[where].mean()
    raw = ((a - m) ** 2).mean(axis=2)[where].mean()
    rmse = np.sqrt(max(square, 0.0)) / mean
    return {
        "pixels": int(where.sum()),
        "rmse": rmse,
        "low": np.sqrt(max(square - 2 * error, 0.0)) / mean,
        "high": np.sqrt(max(square + 2 * error, 0.0)) / mean,
        "raw": np.sqrt(raw) / mean,
        "noise": np.sqrt(noise) / mean,
        "bias": (a[where].mean() - m[where].mean()) / mean,
        "bias_error": np.sqrt(noise / where.sum()) / mean,
        "share": mean * where.sum(),
    }


def block_sums(values, size=8):
    height, width = values.shape
    padded = np.pad(values, ((0, -height % size), (0, -width % size)))
    return padded.reshape(padded.shape[0] // size, size, -1, size).sum(axis=(1, 3)).ravel()


def regions(ours, seen, one_face):
    """All pixels, those on edges and within faces, and by the layer that brings most of what they show."""
    names = ["direct", "specular", "indirect"]
    most = np.argmax([ours[name].sum(axis=2) for name in names], axis=0)
    yield "all diffuse pixels", seen
    yield "within one face", seen & one_face
    yield "across edges of diffuse shapes", seen & ~one_face
    for i, name in enumerate(names):
        yield f"mostly {name}", seen & (most == i)


def report(arguments, ours, seconds, batches, theirs, seen, one_face):
    total = ours["compared"]
    print(f"evolute: accuracy {arguments.accuracy}, {seconds:.0f} processor seconds")
    print(f"ptracer: {theirs['samples']} light paths a pixel in {len(batches)} batches, "
          f"{theirs['seconds']:.0f} processor seconds")
    print()
    print("| region | pixels | part of the light | relative RMSE, noise taken out | (2 s.e.) | with noise "
          "| noise of ptracer's mean | mean, ours/theirs - 1 | ptracer: s for 2 % noise |")
    print("|---|---|---|---|---|---|---|---|---|")
    whole = None
    for name, where in regions(ours, seen, one_face):
        f = figures(total, batches, where)
        if f is None:
            continue
        whole = whole or f["share"]
        # Monte Carlo: time goes as the inverse square of noise.
        needed = theirs["seconds"] * (f["noise"] / 0.02) ** 2
        mark = " (extrapolated)" if needed > theirs["seconds"] else ""
        print(f"| {name} | {f['pixels']} | {100 * f['share'] / whole:.0f} % | {100 * f['rmse']:.2f} % "
              f"| {100 * f['low']:.2f} to {100 * f['high']:.2f} % | {100 * f['raw']:.2f} % | {100 * f['noise']:.2f} % "
              f"| {100 * f['bias']:+.2f} ± {100 * f['bias_error']:.2f} % | {needed:.0f}{mark} |")
    difference = (total - batches.mean(axis=0)).mean(axis=2)
    worst = np.where(seen, pair_products(total, batches).mean(axis=2), -np.inf)
    mean = batches.mean(axis=0)[seen].mean()
    rows = np.argsort(worst, axis=None)[::-1][:8]
    print()
    print("pixels that add most (column, row; difference of radiance over the mean):")
    for at in rows:
        j, i = np.unravel_index(at, worst.shape)
        part = worst[j, i] / max(worst[seen].sum(), 1e-300)
        print(f"  ({i}, {j}) {difference[j, i] / mean:+.3f}, {100 * part:.1f} % of the sum")


def third_opinion(arguments, scene, ours, batches, seen):
    """`path`, which sees no caustics of small lamps: for scenes that have none."""
    integrator = mi.load_dict({"type": "path", "max_depth": depth(arguments)})
    scale = 1 / FAINT if arguments.light == "lamps" else 1.0
    pictures = [scale * np.array(mi.render(scene, integrator=integrator, spp=max(arguments.path // 4, 1), seed=1000 + i),
                         dtype=np.float64)[..., :3] for i in range(4)]
    pictures = np.array(pictures)
    print()
    for name, a in [("evolute", ours["compared"]), ("ptracer", batches.mean(axis=0))]:
        f = figures(a, pictures, seen)
        print(f"{name} against path ({arguments.path} samples a pixel): {100 * f['rmse']:.2f} % "
              f"({100 * f['low']:.2f} to {100 * f['high']:.2f} %), noise of path {100 * f['noise']:.2f} %, "
              f"mean {100 * f['bias']:+.2f} ± {100 * f['bias_error']:.2f} %")


if __name__ == "__main__":
    main()
