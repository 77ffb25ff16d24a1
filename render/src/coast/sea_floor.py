#!/usr/bin/env python3
"""Packs land and sea floor of ETOPO5 (NOAA NGDC 1988, public domain) at half a degree as `sea_floor.png`.

    apt-get download ferret-datasets && dpkg -x ferret-datasets_*.deb .
    render/src/coast/sea_floor.py usr/share/ferret-vis/data/etopo5.cdf [--check]

Rows from the north, columns from 180 W, a byte for the mean of each cell; `sea_floor.rs` says what it stands for.
`--check` compares pixel by pixel with the packed file instead of writing it: other versions of zlib write other bytes.
"""

import array
import hashlib
import math
import pathlib
import struct
import sys
import zlib

SHA256 = "1455d5e5feebd183d0bef5538a750ca8a44801e1503f964df900831c224459ce"
# The variable ROSE: 4-byte floats, most significant byte first; rows from the south pole, columns from 0 E.
ROWS, COLS, BEGIN = 2161, 4320, 52552
CELL = 6  # steps of 5 minutes in a cell
HEIGHT, WIDTH = 360, 720
# A byte is ZERO + SCALE sign(h) |h|^POWER of a height in metres: steps of 12 m at the coast, of 75 m in the deep.
ZERO, SCALE, POWER = 151, 0.238, 0.7


def heights(path):
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != SHA256:
        sys.exit(f"{path} is another file than etopo5.cdf of ferret-datasets 7.6.0")
    numbers = array.array("f", data[BEGIN : BEGIN + 4 * ROWS * COLS])
    if sys.byteorder == "little":
        numbers.byteswap()
    return numbers


def cells(numbers):
    """Means of what lies straight between points, which stand on the edges of cells too: half a weight each there."""
    weights = [0.5] + [1.0] * (CELL - 1) + [0.5]
    for row in range(HEIGHT):
        south = (HEIGHT - 1 - row) * CELL
        lines = [
            (weights[j], numbers[(south + j) * COLS : (south + j + 1) * COLS]) for j in range(CELL + 1)
        ]
        summed = [sum(weight * line[x] for weight, line in lines) for x in range(COLS)]
        own = []
        for col in range(WIDTH):
            west = col * CELL - COLS // 2
            own.append(sum(weights[i] * summed[(west + i) % COLS] for i in range(CELL + 1)) / CELL**2)
        yield from as_wide_as_high(own, 90 - (row + 0.5) * 180 / HEIGHT)


def as_wide_as_high(line, lat):
    """Means over as many cells as are half a degree of a great circle wide: slopes would be steep towards the poles."""
    reach = min(round(0.5 / math.cos(math.radians(lat)) - 0.5), WIDTH // 2 - 1)
    sums = [0.0]
    for x in range(-reach, WIDTH + reach):
        sums.append(sums[-1] + line[x % WIDTH])
    return [(sums[x + 2 * reach + 1] - sums[x]) / (2 * reach + 1) for x in range(WIDTH)]


def code(height):
    return min(max(ZERO + round(math.copysign(SCALE * abs(height) ** POWER, height)), 0), 255)


def png(pixels):
    """Grey, each byte less Paeth's prediction (PNG 1.2, 6.6)."""
    rows, before = [], bytes(WIDTH)
    for row in range(HEIGHT):
        own = pixels[row * WIDTH : (row + 1) * WIDTH]
        line = bytearray([4])
        for x in range(WIDTH):
            a, b, c = own[x - 1] if x else 0, before[x], before[x - 1] if x else 0
            p = a + b - c
            near = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line.append((own[x] - near) & 255)
        rows.append(bytes(line))
        before = own

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0)
    body = zlib.compress(b"".join(rows), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def filtered(content):
    """The rows of a PNG that `png` wrote, still less their predictions."""
    (length,) = struct.unpack_from(">I", content, 33)
    return zlib.decompress(content[41 : 41 + length])


def main():
    content = png(bytes(map(code, cells(heights(pathlib.Path(sys.argv[1]))))))
    path = pathlib.Path(__file__).with_name("sea_floor.png")
    if "--check" in sys.argv[2:]:
        if filtered(path.read_bytes()) != filtered(content):
            sys.exit(f"{path} does not hold the relief of {sys.argv[1]}")
        print(f"{path} holds the relief of {sys.argv[1]}")
    else:
        path.write_bytes(content)
        print(f"{path}: {len(content)} bytes")


main()
