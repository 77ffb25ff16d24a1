//! The arrays of a cube: shape, chunks, codecs and attributes of each, and nothing of what is in them.

use std::sync::Arc;

use contract::grid::Grid;
use contract::level::Level;
use serde_json::{Map, Value, json};
use zarrs::array::codec::{BytesCodec, Crc32cCodec, ZstdCodec};
use zarrs::array::data_type::{float32, float64, int32, int64, uint8};
use zarrs::array::{
    Array, ArrayBuilder, ArrayMetadata, ArrayMetadataOptions, ArrayMetadataV3,
    BytesToBytesCodecTraits, CodecChain, DataType, FillValue,
};

use crate::layout::{BLOCK_CELLS, RUN_STEPS};
use crate::record::RECORD_BYTES;
use crate::{CubeError, Description, Layout, cf};

/// Group of the time-major copy.
pub(crate) const SERIES: &str = "along_time";
/// Group of the copy that programs of before made, which nobody reads: a chunk had the steps of one cell side by side.
pub(crate) const SERIES_OF_BEFORE: &str = "series";
/// Group of sums of blocks.
pub(crate) const SUMS: &str = "sums";
/// Group of coarser levels.
pub(crate) const LEVELS: &str = "levels";
/// Name of the array of the starts of steps, where the bounds are those of sums.
pub(crate) const STEP_START: &str = "step_start";
/// Steps in a chunk of the time coordinate.
pub(crate) const TIME_CHUNK: u64 = 1024;
/// Steps in a chunk of digests, which do not compress.
pub(crate) const DIGEST_CHUNK: u64 = 256;
/// Bytes of a digest.
pub(crate) const DIGEST_BYTES: u64 = 32;
/// What compresses values of steps: level 3 takes twice as long for a thousandth fewer bytes, and level 6 four times as long for three
/// thousandths (docs/decisions/037-quick-landing.md).
const VALUES_ZSTD_LEVEL: i32 = 1;
/// What compresses all else that is small: levels of steps, coordinates, digests.
const ZSTD_LEVEL: i32 = 3;
/// The same of blocks along time and of sums of them: below 0 no numbers are coded bit by bit, and to decode a block takes a third
/// of the time, for a tenth more bytes (docs/decisions/035-quick-statistics.md).
pub(crate) const QUICK_ZSTD_LEVEL: i32 = -1;

/// An array without a store: what it is like.
pub(crate) type Definition = Array<()>;

/// Of one array, what the ways to define them have in common.
struct Shape {
    name: String,
    cells: Vec<u64>,
    chunk: Vec<u64>,
    zstd_level: i32,
    dimensions: &'static [&'static str],
}

/// Values, `[time, lat, lon]`, stored unit, NaN no data.
pub(crate) fn values(description: &Description, steps: u64) -> Result<Definition, CubeError> {
    values_cut(description, steps, Layout::of(&description.grid))
}

/// The same in chunks and objects of a layout.
pub(crate) fn values_cut(
    description: &Description,
    steps: u64,
    layout: Layout,
) -> Result<Definition, CubeError> {
    let grid = &description.grid;
    let shape = Shape {
        name: cf::variable(description.quantity),
        cells: vec![steps, grid.rows.into(), grid.cols.into()],
        chunk: vec![1, layout.object[0].into(), layout.object[1].into()],
        zstd_level: VALUES_ZSTD_LEVEL,
        dimensions: &["time", "lat", "lon"],
    };
    let inner = layout
        .is_sharded()
        .then(|| vec![1, layout.chunk[0].into(), layout.chunk[1].into()]);
    define(
        &shape,
        float32(),
        f32::NAN.into(),
        cf::of_values(description),
        inner,
    )
}

/// The time-major copy of the values, `[time, lat, lon]` of runs: shards of blocks of cells. In a block the cells of a step lie side by
/// side, where values are alike and gaps are whole: it decodes in a third of the time that it would take with the steps of a cell side by side.
pub(crate) fn series(description: &Description, runs: usize) -> Result<Definition, CubeError> {
    let (grid, [rows, cols]) = (
        &description.grid,
        Layout::of(&description.grid).series_object(),
    );
    let run = RUN_STEPS as u64;
    let shape = Shape {
        name: format!("{SERIES}/{}", cf::variable(description.quantity)),
        cells: vec![runs as u64 * run, grid.rows.into(), grid.cols.into()],
        chunk: vec![run, rows.into(), cols.into()],
        zstd_level: QUICK_ZSTD_LEVEL,
        dimensions: &["series_time", "lat", "lon"],
    };
    let block = u64::from(BLOCK_CELLS);
    define(
        &shape,
        float32(),
        f32::NAN.into(),
        cf::of_series(description),
        Some(vec![run, block, block]),
    )
}

/// Sums of blocks, `[block row, block column, byte]` of runs: shards as those of the time-major copy, a chunk a record.
pub(crate) fn sums(description: &Description, runs: usize) -> Result<Definition, CubeError> {
    let (grid, shard) = (
        &description.grid,
        Layout::of(&description.grid).series_object(),
    );
    let record = RECORD_BYTES as u64;
    let blocks = |cells: u32| u64::from(cells.div_ceil(BLOCK_CELLS));
    let shape = Shape {
        name: format!("{SUMS}/blocks"),
        cells: vec![blocks(grid.rows), blocks(grid.cols), runs as u64 * record],
        chunk: vec![blocks(shard[0]), blocks(shard[1]), record],
        zstd_level: QUICK_ZSTD_LEVEL,
        dimensions: &["block_row", "block_col", "byte"],
    };
    let inner = Some(vec![1, 1, record]);
    define(&shape, uint8(), 0u8.into(), Map::new(), inner)
}

/// Folder of a level.
pub(crate) fn level_group(level: &Level) -> String {
    format!("{LEVELS}/{}", level.number)
}

/// Values of a level, `[time, lat, lon]`, stored unit, NaN no data.
pub(crate) fn level_values(
    description: &Description,
    level: &Level,
    steps: u64,
) -> Result<Definition, CubeError> {
    let (shape, inner) = level_shape(level, &cf::variable(description.quantity), steps);
    let attributes = cf::of_level_values(description);
    define(&shape, float32(), f32::NAN.into(), attributes, inner)
}

/// How much of each cell of a level holds data, `[time, lat, lon]`.
pub(crate) fn level_coverage(
    description: &Description,
    level: &Level,
    steps: u64,
) -> Result<Definition, CubeError> {
    let (shape, inner) = level_shape(level, &cf::coverage(description.quantity), steps);
    define(&shape, uint8(), 0u8.into(), cf::of_coverage(), inner)
}

fn level_shape(level: &Level, name: &str, steps: u64) -> (Shape, Option<Vec<u64>>) {
    let (grid, layout) = (&level.grid, Layout::of_level(&level.grid));
    let along_time = |[rows, cols]: [u32; 2]| vec![1, rows.into(), cols.into()];
    let shape = Shape {
        name: format!("{}/{name}", level_group(level)),
        cells: vec![steps, grid.rows.into(), grid.cols.into()],
        chunk: along_time(layout.object),
        zstd_level: ZSTD_LEVEL,
        dimensions: &["time", "lat", "lon"],
    };
    let inner = layout.is_sharded().then(|| along_time(layout.chunk));
    (shape, inner)
}

/// Of each step the digest of the values that its levels were made of, `[time, byte]`; zeros where they are not there.
pub(crate) fn level_names(steps: usize) -> Result<Definition, CubeError> {
    let shape = Shape {
        name: format!("{LEVELS}/steps_sha256"),
        cells: vec![steps as u64, DIGEST_BYTES],
        chunk: vec![DIGEST_CHUNK, DIGEST_BYTES],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["time", "sha256_byte"],
    };
    define(&shape, uint8(), 0u8.into(), cf::of_level_names(), None)
}

/// Of each step the smallest and the largest of the values that its levels were made of, `[time, 2]`.
pub(crate) fn level_ranges(steps: usize) -> Result<Definition, CubeError> {
    let shape = Shape {
        name: format!("{LEVELS}/range"),
        cells: vec![steps as u64, 2],
        chunk: vec![TIME_CHUNK, 2],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["time", "least_most"],
    };
    define(&shape, float32(), 0f32.into(), cf::of_ranges(), None)
}

/// What a cell of each row of a grid weighs in sums, `[row]`.
pub(crate) fn row_weights(grid: &Grid) -> Result<Definition, CubeError> {
    let shape = Shape {
        name: format!("{SUMS}/row_weights"),
        cells: vec![grid.rows.into()],
        chunk: vec![grid.rows.into()],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["row"],
    };
    define(&shape, int64(), 0i64.into(), Map::new(), None)
}

/// Of each run of a group what it was made of, `[run, byte]`; zeros of one that is not there.
pub(crate) fn runs(group: &str, runs: usize) -> Result<Definition, CubeError> {
    let shape = Shape {
        name: format!("{group}/steps_sha256"),
        cells: vec![runs as u64, DIGEST_BYTES],
        chunk: vec![DIGEST_CHUNK, DIGEST_BYTES],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["run", "sha256_byte"],
    };
    define(&shape, uint8(), 0u8.into(), cf::of_runs(), None)
}

/// Codecs of one chunk of values, which in a shard is a part of an object.
pub(crate) fn chunk_codecs() -> CodecChain {
    CodecChain::new(vec![], Arc::new(BytesCodec::little()), checked(ZSTD_LEVEL))
}

/// Compressed, and with a checksum of what is stored.
fn checked(zstd_level: i32) -> Vec<Arc<dyn BytesToBytesCodecTraits>> {
    vec![
        Arc::new(ZstdCodec::new(zstd_level, false)),
        Arc::new(Crc32cCodec::new()),
    ]
}

/// Arrays along time, besides the values.
pub(crate) struct Axis {
    /// Where a step's value holds, `[time]`.
    pub(crate) time: Definition,
    /// What it is a mean or a sum over, `[time, 2]`.
    pub(crate) bounds: Definition,
    /// First instant of the step itself where the bounds are those of a sum, `[time]`.
    pub(crate) step_start: Option<Definition>,
    /// Digest of its values, `[time, byte]`.
    pub(crate) digests: Definition,
}

impl Axis {
    /// All of them.
    pub(crate) fn arrays(&self) -> impl Iterator<Item = &Definition> {
        let start = self.step_start.iter();
        [&self.time, &self.bounds, &self.digests]
            .into_iter()
            .chain(start)
    }
}

/// The arrays along time for a number of steps.
pub(crate) fn axis(is_sum: bool, steps: u64) -> Result<Axis, CubeError> {
    axis_in("", is_sum, steps)
}

/// Those that a level has too: where a step's value holds, and its bounds.
pub(crate) fn level_axis(
    level: &Level,
    is_sum: bool,
    steps: u64,
) -> Result<[Definition; 2], CubeError> {
    let axis = axis_in(&format!("{}/", level_group(level)), is_sum, steps)?;
    Ok([axis.time, axis.bounds])
}

fn axis_in(folder: &str, is_sum: bool, steps: u64) -> Result<Axis, CubeError> {
    let instants = |name: &str, attributes| {
        let shape = Shape {
            name: format!("{folder}{name}"),
            cells: vec![steps],
            chunk: vec![TIME_CHUNK],
            zstd_level: ZSTD_LEVEL,
            dimensions: &["time"],
        };
        define(&shape, int64(), 0i64.into(), attributes, None)
    };
    let bounds = Shape {
        name: format!("{folder}time_bnds"),
        cells: vec![steps, 2],
        chunk: vec![TIME_CHUNK, 2],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["time", "bnds"],
    };
    let digests = Shape {
        name: format!("{folder}values_sha256"),
        cells: vec![steps, DIGEST_BYTES],
        chunk: vec![DIGEST_CHUNK, DIGEST_BYTES],
        zstd_level: ZSTD_LEVEL,
        dimensions: &["time", "sha256_byte"],
    };
    Ok(Axis {
        time: instants("time", cf::of_time())?,
        bounds: define(&bounds, int64(), 0i64.into(), Map::new(), None)?,
        step_start: is_sum
            .then(|| instants(STEP_START, cf::of_step_start()))
            .transpose()?,
        digests: define(&digests, uint8(), 0u8.into(), cf::of_digests(), None)?,
    })
}

/// An array that never changes, and its values.
pub(crate) enum Fixed {
    Floats(Definition, Vec<f64>),
    Number(Definition, i32),
}

/// Latitudes, longitudes, their bounds and the grid mapping.
pub(crate) fn fixed(description: &Description) -> Result<Vec<Fixed>, CubeError> {
    fixed_in("", places(&description.grid))
}

/// The same of a level.
pub(crate) fn level_fixed(
    description: &Description,
    level: &Level,
) -> Result<Vec<Fixed>, CubeError> {
    let grid = &description.grid;
    let rows = level.row_edges(grid);
    let cols = level.col_edges(grid);
    let places = (
        Places::between(&rows, &|row| grid.row_north_deg(row)),
        Places::between(&cols, &|col| grid.col_west_deg(col)),
    );
    fixed_in(&format!("{}/", level_group(level)), places)
}

fn fixed_in(folder: &str, (lat, lon): (Places, Places)) -> Result<Vec<Fixed>, CubeError> {
    let crs = Shape {
        name: format!("{folder}crs"),
        cells: vec![],
        chunk: vec![],
        zstd_level: ZSTD_LEVEL,
        dimensions: &[],
    };
    let named = |name: &str| format!("{folder}{name}");
    Ok(vec![
        floats(named("lat"), &["lat"], cf::of_lat(), lat.centres)?,
        floats(named("lat_bnds"), &["lat", "bnds"], Map::new(), lat.bounds)?,
        floats(named("lon"), &["lon"], cf::of_lon(), lon.centres)?,
        floats(named("lon_bnds"), &["lon", "bnds"], Map::new(), lon.bounds)?,
        Fixed::Number(define(&crs, int32(), 0i32.into(), cf::of_crs(), None)?, 0),
    ])
}

/// The rows, or the columns, of a grid.
pub struct Places {
    /// Degrees.
    pub centres: Vec<f64>,
    /// Two a cell, in the order of the centres: degrees.
    pub bounds: Vec<f64>,
}

impl Places {
    /// Cells between edges, whose places are told by their numbers.
    fn between(edges: &[u32], deg: &dyn Fn(u32) -> f64) -> Self {
        let pairs = edges.windows(2).map(|pair| [deg(pair[0]), deg(pair[1])]);
        let centre = |[from, to]: [f64; 2]| contract::grid::rounded_deg(0.5 * (from + to));
        Self {
            centres: pairs.clone().map(centre).collect(),
            bounds: pairs.flatten().map(contract::grid::rounded_deg).collect(),
        }
    }
}

/// Latitudes north to south and longitudes eastwards, past 180 where the grid crosses the date line.
pub fn places(grid: &Grid) -> (Places, Places) {
    let edges = |count: u32| (0..=count).collect::<Vec<_>>();
    (
        Places::between(&edges(grid.rows), &|row| grid.row_north_deg(row)),
        Places::between(&edges(grid.cols), &|col| grid.col_west_deg(col)),
    )
}

fn floats(
    name: String,
    dimensions: &'static [&'static str],
    attributes: Map<String, Value>,
    values: Vec<f64>,
) -> Result<Fixed, CubeError> {
    let cells = match dimensions.len() {
        1 => vec![values.len() as u64],
        _ => vec![values.len() as u64 / 2, 2],
    };
    let shape = Shape {
        name,
        chunk: cells.clone(),
        cells,
        zstd_level: ZSTD_LEVEL,
        dimensions,
    };
    let definition = define(&shape, float64(), f64::NAN.into(), attributes, None)?;
    Ok(Fixed::Floats(definition, values))
}

fn define(
    shape: &Shape,
    data_type: DataType,
    fill: FillValue,
    attributes: Map<String, Value>,
    inner_chunk: Option<Vec<u64>>,
) -> Result<Definition, CubeError> {
    let mut builder = ArrayBuilder::new(shape.cells.clone(), shape.chunk.clone(), data_type, fill);
    builder
        .bytes_to_bytes_codecs(checked(shape.zstd_level))
        .dimension_names(Some(shape.dimensions.iter().copied()))
        .attributes(attributes)
        .subchunk_shape(inner_chunk);
    let path = format!("/{}", shape.name);
    // Attributes are the conventions' and ours, not the library's.
    let options = ArrayMetadataOptions::default().with_include_zarrs_metadata(false);
    builder
        .build(Arc::new(()), &path)
        .map(|array| array.with_metadata_options(options))
        .map_err(|e| CubeError::library(&path, "defining the array", e))
}

/// Name of an array, without the slash of its path.
pub(crate) fn name<S: ?Sized>(array: &Array<S>) -> String {
    array.path().as_str().trim_start_matches('/').to_owned()
}

/// Is an array that was found what it is defined to be, but for its length along time?
///
/// # Errors
/// `Foreign` with the first thing that differs.
pub(crate) fn check<S: ?Sized>(
    found: &Array<S>,
    defined: &Definition,
    place: &str,
) -> Result<(), CubeError> {
    let foreign = |reason: String| CubeError::Foreign {
        place: place.to_owned(),
        array: name(defined),
        reason,
    };
    let (ArrayMetadata::V3(found), ArrayMetadata::V3(defined)) =
        (found.metadata(), defined.metadata())
    else {
        return Err(foreign("it is not of Zarr version 3".to_owned()));
    };
    let same_places = found.shape.len() == defined.shape.len()
        && found.shape.iter().skip(1).eq(defined.shape.iter().skip(1));
    if !same_places {
        return Err(foreign(format!(
            "its shape is {:?}, not {:?} along any time",
            found.shape, defined.shape
        )));
    }
    let facts = |array: &ArrayMetadataV3| {
        [
            ("data type", written_out(json!(array.data_type))),
            ("chunks", written_out(json!(array.chunk_grid))),
            ("codecs", without_level(written_out(json!(array.codecs)))),
            ("fill value", json!(array.fill_value)),
            (
                "names of chunks",
                written_out(json!(array.chunk_key_encoding)),
            ),
        ]
    };
    for ((what, found), (_, defined)) in facts(found).into_iter().zip(facts(defined)) {
        if found != defined {
            return Err(foreign(format!("its {what} are {found}, not {defined}")));
        }
    }
    Ok(())
}

/// Codecs as they are to who reads: any level of compression is decoded alike, and earlier programs chose another.
fn without_level(codecs: Value) -> Value {
    match codecs {
        Value::Array(codecs) => codecs.into_iter().map(without_level).collect(),
        Value::Object(mut codec) => {
            if codec.get("name").is_some_and(|name| name == "zstd")
                && let Some(Value::Object(own)) = codec.get_mut("configuration")
            {
                own.remove("level");
            }
            let inner = codec
                .into_iter()
                .map(|(name, own)| (name, without_level(own)));
            Value::Object(inner.collect())
        }
        other => other,
    }
}

/// A thing by its name and settings: the format lets one without settings be its name alone.
fn written_out(thing: Value) -> Value {
    match thing {
        Value::String(name) => json!({ "name": name }),
        Value::Array(things) => things.into_iter().map(written_out).collect(),
        thing => thing,
    }
}
