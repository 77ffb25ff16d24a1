#!/usr/bin/env python3
"""Makes 500 regions and their areas, and shares nothing with Fluxglobe: shapely and pyproj say what they hold.

    region_areas.py FOLDER    writes NNN.geojson, NNN.wkt and areas.json (kind, area in m2 by number) there

What a region holds, as RFC 7946 has it: edges are straight in longitude and latitude; inside of a ring is what it goes
round, in either direction and however often (non-zero rule); a polygon is its outer ring less its holes; a region is the
union of its polygons on the earth, so that longitudes 190 and -170 are one place. Shapely 2.2 (GEOS) does the geometry in
the plane of longitude and latitude. The area is that of the outline cut into pieces of at most 0.02
degrees and 1/200 of its size, and mapped by pyproj 3.7 (PROJ) to the equal-area cylindrical projection of the WGS84
ellipsoid; pieces half as long change no area by more than 2 parts in 10^7 (`--check-pieces` measures it). `make test` installs both, pinned (deploy/install-tools.sh).
"""

import json
import math
import random
import sys
from pathlib import Path

import numpy as np
import pyproj
import shapely
from shapely.affinity import translate
from shapely.geometry import LineString, Polygon, box
from shapely.ops import polygonize, unary_union

PIECE_DEG, PIECE_SHARE = 0.02, 1 / 200
TO_EQUAL_AREA = pyproj.Transformer.from_crs(
    "OGC:CRS84", pyproj.CRS.from_proj4("+proj=cea +ellps=WGS84 +units=m"), always_xy=True
)
WORLD = box(-180, -90, 180, 90)


def rectangle(west, south, east, north):
    return [(west, south), (east, south), (east, north), (west, north)]


def star(rng, lon, lat, radius, corners, rough=0.6):
    """A ring round a centre that never crosses itself, within the latitudes of the earth."""
    ring = []
    for i in range(corners):
        angle = 2 * math.pi * (i + rng.random() * 0.8) / corners
        reach = radius * (1 - rough * rng.random())
        ring.append((lon + reach * math.cos(angle), max(-90.0, min(90.0, lat + reach * math.sin(angle)))))
    return ring


def wide(rng):
    """Up to all round, as rectangles and as bands with slanted ends."""
    width = rng.choice([200, 260, 358, 360, rng.uniform(181, 360)])
    west = rng.choice([-180.0, -width / 2, rng.uniform(-180, 180)])
    south = rng.uniform(-85, 40)
    north = south + rng.uniform(1, 45)
    ring = rectangle(west, south, west + width, north)
    if rng.random() < 0.5:
        inset = width * rng.uniform(0, 0.4)
        ring[2], ring[3] = (ring[2][0] - inset, north), (ring[3][0] + inset, north)
    if rng.random() < 0.5:
        ring.reverse()
    return [[ring]]


def nested(rng):
    """Holes, islands in them, polygons inside of polygons, holes that overlap or reach out of their ring."""
    lon, lat, radius = rng.uniform(-150, 150), rng.uniform(-60, 60), rng.uniform(2, 20)
    rings = [star(rng, lon, lat, radius, rng.randint(5, 40), 0.3)]
    for _ in range(rng.randint(1, 3)):
        off = radius * rng.uniform(0, 0.9)
        rings.append(star(rng, lon + off, lat - off / 2, radius * rng.uniform(0.1, 0.4), rng.randint(3, 12)))
    polygons = [rings]
    for _ in range(rng.randint(0, 3)):
        polygons.append([star(rng, lon + rng.uniform(-1, 1), lat, radius * rng.uniform(0.05, 0.5), rng.randint(3, 12))])
    return polygons


def touching(rng):
    """Boxes that share edges or corners, triangles that share a corner with a ring's edge."""
    lon, lat, size = rng.uniform(-170, 150), rng.uniform(-70, 60), rng.uniform(0.3, 8)
    boxes = [rectangle(lon + size * i, lat + size * j, lon + size * (i + 1), lat + size * (j + 1))
             for i in range(3) for j in range(2) if rng.random() < 0.8]
    hole = [(lon + size * 0.5, lat), (lon + size * 0.7, lat + size * 0.5), (lon + size * 0.3, lat + size * 0.5)]
    boxes.append(rectangle(lon + size / 2, lat - size, lon + size * 1.5, lat))
    return [[ring] for ring in boxes] + [[rectangle(lon, lat, lon + size, lat + size), hole]]


def date_line(rng):
    """Longitudes past 180, and parts of the other side that overlap with them."""
    lon, lat = rng.choice([-180, 180]) + rng.uniform(-8, 8), rng.uniform(-70, 70)
    polygons = [[star(rng, lon, lat, rng.uniform(2, 15), rng.randint(4, 60))]]
    if rng.random() < 0.7:
        other = lon - math.copysign(360, lon) + rng.uniform(-6, 6)
        polygons.append([star(rng, other, lat + rng.uniform(-4, 4), rng.uniform(2, 12), rng.randint(4, 30))])
    return polygons


def pole(rng):
    """Caps that are led to the pole along 180 and back along -180, some with a hole."""
    sign = rng.choice([-1, 1])
    count = rng.randint(3, 200)
    coast = [(-180 + 360 * i / count, sign * rng.uniform(55, 85)) for i in range(count + 1)]
    coast[-1] = (180.0, coast[0][1])
    rings = [coast + [(180.0, 90.0 * sign), (-180.0, 90.0 * sign)]]
    if rng.random() < 0.5:
        rings.append(star(rng, rng.uniform(-170, 170), 86 * sign, 2.0, 9))
    return [rings]


def tiny(rng):
    """From 10 m to 1 km, alone, repeated or beside each other."""
    size = 10 ** rng.uniform(-4, -2)
    lon, lat = rng.uniform(-179.9, 179.9), rng.uniform(-80, 80)
    ring = star(rng, lon, lat, size, rng.randint(3, 20))
    polygons = [[ring]]
    if rng.random() < 0.5:
        polygons.append([ring] if rng.random() < 0.5 else [star(rng, lon + size, lat, size, rng.randint(3, 20))])
    return polygons


def crossing(rng):
    """Bow-ties, stars drawn in one stroke, and corners joined anyhow."""
    lon, lat, radius = rng.uniform(-160, 160), rng.uniform(-60, 60), rng.uniform(0.2, 20)
    choice = rng.randint(0, 2)
    if choice == 0:
        a, b, c, d = rectangle(lon, lat, lon + radius, lat + radius * rng.uniform(0.2, 1))
        return [[[a, c, b, d]]]
    count = rng.choice([5, 7, 9, 11])
    angles = [2 * math.pi * i * (count // 2) / count for i in range(count)]
    if choice == 1:
        return [[[(lon + radius * math.cos(a), lat + radius * math.sin(a)) for a in angles]]]
    return [[[(lon + rng.uniform(-radius, radius), lat + rng.uniform(-radius, radius)) for _ in range(count)]]]


def repeated(rng):
    """The same polygon two or three times, also backwards and a turn away."""
    ring = star(rng, rng.uniform(-150, 150), rng.uniform(-60, 60), rng.uniform(0.1, 15), rng.randint(3, 30))
    copies = [[ring], [ring[::-1]]]
    if rng.random() < 0.5:
        copies.append([[(lon + 360, lat) for lon, lat in ring]])
    return copies


def many_corners(rng):
    return [[star(rng, rng.uniform(-140, 140), rng.uniform(-40, 40), rng.uniform(5, 40), 100_000, 0.02)]]


KINDS = [(wide, 80), (nested, 80), (touching, 60), (date_line, 80), (pole, 50), (tiny, 60), (crossing, 50), (repeated, 36),
         (many_corners, 4)]  # fmt: skip


def winding(ring, point):
    """How often a ring goes round a point, counted against the clock."""
    corners = np.array(ring)
    a, b = corners, np.roll(corners, -1, axis=0)
    left = (b[:, 0] - a[:, 0]) * (point.y - a[:, 1]) - (point.x - a[:, 0]) * (b[:, 1] - a[:, 1])
    up = (a[:, 1] <= point.y) & (b[:, 1] > point.y) & (left > 0)
    down = (a[:, 1] > point.y) & (b[:, 1] <= point.y) & (left < 0)
    return int(up.sum()) - int(down.sum())


def inside(ring):
    polygon = Polygon(ring)
    if polygon.is_valid:
        return polygon
    faces = polygonize(unary_union(LineString(ring + ring[:1])))
    return unary_union([face for face in faces if winding(ring, face.representative_point())])


def on_earth(polygons):
    parts = []
    for outer, *holes in polygons:
        flat = inside(outer).difference(unary_union([inside(hole) for hole in holes])) if holes else inside(outer)
        west, _, east, _ = flat.bounds
        for turn in range(-2, 3):
            if west + 360 * turn < 180 and east + 360 * turn > -180:
                moved = translate(flat, 360 * turn) if turn else flat
                parts.append(moved.intersection(WORLD) if west + 360 * turn < -180 or east + 360 * turn > 180 else moved)
    return unary_union(parts)


def area_m2(geometry, finer=1):
    west, south, east, north = geometry.bounds
    pieces = shapely.segmentize(geometry, min(PIECE_DEG, PIECE_SHARE * max(east - west, north - south)) / finer)
    return shapely.transform(pieces, lambda c: np.column_stack(TO_EQUAL_AREA.transform(c[:, 0], c[:, 1]))).area


def text(polygons):
    """As GeoJSON and as well-known text, every number in full."""
    closed = [[ring + ring[:1] for ring in rings] for rings in polygons]
    wkt = ",".join(
        "(" + ",".join("(" + ",".join(f"{lon!r} {lat!r}" for lon, lat in ring) + ")" for ring in rings) + ")"
        for rings in closed
    )
    if len(closed) == 1:
        return json.dumps({"type": "Polygon", "coordinates": closed[0]}), f"POLYGON{wkt}"
    return json.dumps({"type": "MultiPolygon", "coordinates": closed}), f"MULTIPOLYGON({wkt})"


def main():
    folder, rng, areas, worst = Path(sys.argv[1]), random.Random(7946), [], 0.0
    for kind, count in KINDS:
        for _ in range(count):
            polygons = [[[(float(lon), float(lat)) for lon, lat in ring] for ring in rings] for rings in kind(rng)]
            geojson, wkt = text(polygons)
            (folder / f"{len(areas):03}.geojson").write_text(geojson)
            (folder / f"{len(areas):03}.wkt").write_text(wkt)
            geometry = on_earth(polygons)
            area = area_m2(geometry)
            if "--check-pieces" in sys.argv:
                worst = max(worst, abs(area_m2(geometry, 2) / area - 1))
            areas.append({"kind": kind.__name__, "area_m2": area})
    (folder / "areas.json").write_text(json.dumps(areas))
    if "--check-pieces" in sys.argv:
        print(f"pieces half as long change areas by at most {worst:.1e}")


main()
