#!/usr/bin/env python3
"""Checks that a group says of its coarser levels what the multiscales convention (zarr-conventions, v0.1) asks for.

    multiscales.py DOCUMENT    the group's zarr.json with consolidated metadata, as the server gives it

By the JSON schema beside this file, which is written from the convention's text, and by the rules that no schema can say: assets are
arrays that the document lists, made of one another without circles, with a scale and a translation for each dimension that fit both
shapes. Prints JSON: the assets. Shares nothing with Fluxglobe.
"""

import json
import math
import pathlib
import sys

import jsonschema

SCHEMA = pathlib.Path(__file__).with_suffix(".schema.json")


def check(document):
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    errors = list(jsonschema.Draft202012Validator(schema).iter_errors(document))
    if errors:
        error = jsonschema.exceptions.best_match(errors)
        sys.exit(f"{error.json_path}: {error.message}")
    nodes = document["consolidated_metadata"]["metadata"]
    before = {}
    for entry in document["attributes"]["multiscales"]["layout"]:
        asset, source, transform = entry["asset"], entry.get("derived_from"), entry["transform"]
        assert asset not in before, f"{asset} is listed twice"
        assert nodes.get(asset, {}).get("node_type") == "array", f"{asset} is no array of the document"
        shape = nodes[asset]["shape"]
        for name, numbers in transform.items():
            assert len(numbers) == len(shape), f"{asset}: {name} has {len(numbers)} numbers for {len(shape)} dimensions"
        if source is not None:
            assert source in before, f"{asset} was made of {source}, which is not listed before it"
            assert nodes[asset]["dimension_names"] == nodes[source]["dimension_names"], f"{asset} has other dimensions"
            scaled = [math.ceil(side / scale) for side, scale in zip(before[source], transform["scale"], strict=True)]
            assert scaled == shape, f"{asset}: its scales lead from {before[source]} to {scaled}, and it has {shape}"
        before[asset] = shape
    return list(before)


if __name__ == "__main__":
    with open(sys.argv[1]) as file:
        print(json.dumps(check(json.load(file))))
