// Writes what zarrita reads of a product at an address of the server, for tests/reference/interop.py to compare with the source file:
//   node zarrita.mjs http://HOST/zarr/PRODUCT FOLDER
// Arrays of the product and of its coarser levels are read as a page reads them, those along time step by step, and written whole, in
// little-endian bytes; groups.json says their shapes, types, dimensions and attributes.

import { mkdir, open, writeFile } from "node:fs/promises";
import { join } from "node:path";
import * as zarr from "zarrita";

const [address, folder] = process.argv.slice(2);
// What a product has beside its arrays is not for other programs: series, sums, and what levels were made of.
const GROUP = /^\/(levels\/\d+)?$/;

/** All values of an array, read step by step where it lies along time and the map. */
async function* valuesOf(array) {
  if (array.shape.length < 3) {
    yield await zarr.get(array);
    return;
  }
  for (let step = 0; step < array.shape[0]; step += 1) {
    yield await zarr.get(array, [step, ...array.shape.slice(1).map(() => null)]);
  }
}

/** Writes the values, whose count is that of the shape. */
async function writeValues(array, path) {
  let count = 0;
  const file = await open(path, "w");
  for await (const { data } of valuesOf(array)) {
    count += data.length;
    await file.write(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  }
  await file.close();
  const expected = array.shape.reduce((product, side) => product * side, 1);
  if (count !== expected) throw new Error(`${array.path}: ${count} values of ${expected}`);
}

const store = await zarr.withConsolidatedMetadata(new zarr.FetchStore(address));
const root = await zarr.open.v3(store, { kind: "group" });
const groups = { "": { attributes: root.attrs, arrays: {} } };
for (const { path, kind } of store.contents()) {
  const slash = path.lastIndexOf("/");
  const [group, name] = [path.slice(0, slash) || "/", path.slice(slash + 1)];
  if (kind !== "array" || !GROUP.test(group)) continue;
  const array = await zarr.open.v3(root.resolve(path), { kind: "array" });
  // The array that says what places mean holds no values.
  if (array.shape.length === 0) continue;
  const of = group.slice(1);
  await mkdir(join(folder, of), { recursive: true });
  const values = join(folder, of, `${name}.bin`);
  await writeValues(array, values);
  groups[of] ??= { attributes: {}, arrays: {} };
  groups[of].arrays[name] = {
    values,
    shape: array.shape,
    type: array.dtype,
    dimensions: array.dimensionNames,
    attributes: array.attrs ?? {},
  };
}
await writeFile(join(folder, "groups.json"), JSON.stringify(groups));
