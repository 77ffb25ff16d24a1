#!/usr/bin/env python3
"""Packs the land of Natural Earth (1:50 million, public domain) as `land.bin`; `land.rs` says how it is read.

    npm pack world-atlas@2.0.2 && tar xzf world-atlas-2.0.2.tgz
    contract/src/land/pack.py package/land-50m.json [--check]

`--check` compares with the packed file instead of writing it. Every outer ring is kept: led round the earth the short
way where the source was stitched at the date line, closed over the pole (Antarctica), then cut at the date line. Holes
are left out: the source has two, the Caspian Sea, which counts as land as lakes do, and the south pole itself.
"""

import hashlib
import json
import pathlib
import sys

SHA256 = "619477ff690c086885e45cb91707d783805561bd75ae8e437b7d4694b0204e0f"
PARTS_PER_DEG = 1000  # 111 m, a tenth of what the scale resolves
WORLD = 180 * PARTS_PER_DEG


def rings(topology):
    """Outer rings as lists of places in parts of a degree."""
    (sx, sy), (tx, ty) = topology["transform"]["scale"], topology["transform"]["translate"]
    arcs = []
    for arc in topology["arcs"]:
        x = y = 0
        places = []
        for dx, dy in arc:
            x, y = x + dx, y + dy
            places.append((round((x * sx + tx) * PARTS_PER_DEG), round((y * sy + ty) * PARTS_PER_DEG)))
        arcs.append(places)
    for geometry in topology["objects"]["land"]["geometries"]:
        for polygon in geometry["arcs"]:
            ring = []
            for index in polygon[0]:
                ring += (arcs[index] if index >= 0 else arcs[~index][::-1])[1 if ring else 0 :]
            yield ring[:-1]


def unwrapped(ring):
    """Longitudes that go on past 180, and a ring that goes round the earth closed over the south pole."""
    out, turn = [], 0
    for i, (x, y) in enumerate(ring):
        if i:
            step = x - ring[i - 1][0]
            turn += (step < -WORLD) - (step > WORLD)
        out.append((x + turn * 2 * WORLD, y))
    step = ring[0][0] - ring[-1][0]
    turn += (step < -WORLD) - (step > WORLD)
    if turn:
        assert abs(turn) == 1 and max(y for _, y in ring) < -60 * PARTS_PER_DEG, "only Antarctica holds a pole"
        x, y = ring[0]
        pole = -90 * PARTS_PER_DEG
        out += [(x + turn * 2 * WORLD, y), (x + turn * 2 * WORLD, pole), (x, pole)]
    return out


def cut(ring, limit, above):
    """The part of a ring on one side of a meridian; parts that fall apart stay joined along it."""
    keep = (lambda p: p[0] >= limit) if above else (lambda p: p[0] <= limit)
    out = []
    for a, b in zip(ring, ring[1:] + ring[:1]):
        if keep(a):
            out.append(a)
        if keep(a) != keep(b):
            out.append((limit, round(a[1] + (b[1] - a[1]) * (limit - a[0]) / (b[0] - a[0]))))
    return out


def in_the_world(ring):
    for turn in (-2 * WORLD, 0, 2 * WORLD):
        part = cut(cut([(x + turn, y) for x, y in ring], -WORLD, True), WORLD, False)
        part = [p for i, p in enumerate(part) if p != part[i - 1]]
        if len(part) >= 3 and any(p[0] != part[0][0] for p in part) and any(p[1] != part[0][1] for p in part):
            yield part


def packed(all_rings):
    """Counts and zigzag differences of places as LEB128."""
    out = bytearray()

    def put(number):
        while number >= 0x80:
            out.append(number & 0x7F | 0x80)
            number >>= 7
        out.append(number)

    put(len(all_rings))
    for ring in all_rings:
        put(len(ring))
        before = (0, 0)
        for place in ring:
            for now, then in zip(place, before):
                step = now - then
                put(step << 1 if step >= 0 else (-step << 1) - 1)
            before = place
    return bytes(out)


def main():
    source = pathlib.Path(sys.argv[1]).read_bytes()
    if hashlib.sha256(source).hexdigest() != SHA256:
        sys.exit(f"{sys.argv[1]} is another file than land-50m.json of world-atlas 2.0.2")
    pieces = [piece for ring in rings(json.loads(source)) for piece in in_the_world(unwrapped(ring))]
    content = packed(pieces)
    path = pathlib.Path(__file__).with_name("land.bin")
    if "--check" in sys.argv[2:]:
        if path.read_bytes() != content:
            sys.exit(f"{path} does not hold the land of {sys.argv[1]}")
        print(f"{path} is the land of {sys.argv[1]}")
    else:
        path.write_bytes(content)
        print(f"{path}: {len(pieces)} rings, {sum(map(len, pieces))} places, {len(content)} bytes")


main()
