//! One GeoTIFF a step: 32-bit values on WGS 84, NaN for no data, with the period of the step and the unit as GDAL keeps them.

use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use contract::grid::Grid;
use contract::time::{Period, TimeMs};
use cube::Description;
use tempfile::TempDir;
use tiff::encoder::compression::{CompressionAlgorithm as _, Deflate};
use tiff::encoder::{DeflateLevel, DirectoryEncoder, Rational, TiffEncoder, TiffKind};
use tiff::tags::{
    CompressionMethod, PhotometricInterpretation, Predictor, ResolutionUnit, SampleFormat, Tag,
};
use tiff::{TiffError, TiffResult};

use crate::cells::Cells;
use crate::{ExportError, Values, Written, folder_of};

/// What GDAL says of a file, XML.
const GDAL_METADATA: u16 = 42112;
/// Geographic coordinates (1024: 2), cells are areas (1025: 1), WGS 84 (2048: 4326): version 1.1.0, three keys.
const WGS84_KEYS: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326];
/// Bytes of a strip before it is packed, which is made of whole rows.
const STRIP_BYTES: u32 = 1_000_000;
/// Values beyond need 64-bit offsets.
const BIG_BYTES: u64 = 3 << 30;

/// The folder as it is being filled.
pub struct GeoTiffs {
    path: PathBuf,
    part: TempDir,
    description: Description,
}

impl GeoTiffs {
    pub(crate) fn create(path: &Path, description: &Description) -> Result<Self, ExportError> {
        let part = tempfile::Builder::new()
            .prefix(".export-")
            .tempdir_in(folder_of(path));
        Ok(Self {
            path: path.to_owned(),
            part: part.map_err(ExportError::io(path))?,
            description: description.clone(),
        })
    }
}

impl Written for GeoTiffs {
    fn append(&mut self, period: Period, values: Values<'_>) -> Result<(), ExportError> {
        let grid = &self.description.grid;
        let name = format!("{}_{}.tif", self.description.product, compact(period.start));
        let path = self.part.path().join(&name);
        let file = File::create_new(&path).map_err(ExportError::io(&path))?;
        let mut file = BufWriter::new(file);
        let is_big = grid.cell_count() as u64 * 4 > BIG_BYTES;
        let failed = |e: TiffError| ExportError::library(&path)(e);
        let step = (&self.description, period, Cells::new(values, grid));
        if is_big {
            write(
                TiffEncoder::new_big(&mut file).map_err(failed)?,
                step,
                failed,
            )?;
        } else {
            write(TiffEncoder::new(&mut file).map_err(failed)?, step, failed)?;
        }
        file.flush().map_err(ExportError::io(&path))
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let Self { path, part, .. } = *self;
        open_to_all(part.path()).map_err(ExportError::io(&path))?;
        // An empty folder gives way, any other refuses; what was not moved goes with its guard.
        std::fs::rename(part.path(), &path).map_err(ExportError::io(&path))
    }
}

/// Temporary folders are for their owner alone; what was exported is like any other folder.
fn open_to_all(folder: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755))?;
    }
    Ok(())
}

/// Writes the one image of a file strip by strip.
fn write<W: Write + Seek, K: TiffKind>(
    mut tiff: TiffEncoder<W, K>,
    (description, period, mut cells): (&Description, Period, Cells<'_>),
    failed: impl Fn(TiffError) -> ExportError,
) -> Result<(), ExportError> {
    let Grid { rows, cols, .. } = description.grid;
    let mut image = tiff.image_directory().map_err(&failed)?;
    let strip_rows = STRIP_BYTES.div_ceil(cols.saturating_mul(4)).max(1);
    of_image(&mut image, [rows, cols, strip_rows]).map_err(&failed)?;
    describe(&mut image, description, period).map_err(&failed)?;
    let (mut offsets, mut sizes) = (vec![], vec![]);
    while let Some(strip) = cells.next(strip_rows as usize * cols as usize)? {
        let bytes: Vec<u8> = strip.iter().flat_map(|value| value.to_ne_bytes()).collect();
        let mut packed = vec![];
        let size = Deflate::with_level(DeflateLevel::Balanced).write_to(&mut packed, &bytes);
        let size = size.map_err(|e| failed(e.into()))?;
        let offset = image.write_data(&packed[..]).map_err(&failed)?;
        offsets.push(K::convert_offset(offset).map_err(&failed)?);
        sizes.push(K::convert_offset(size).map_err(&failed)?);
    }
    let kind = [SampleFormat::IEEEFP.to_u16()];
    let ended = image
        .write_tag(Tag::BitsPerSample, &[32u16][..])
        .and_then(|()| image.write_tag(Tag::SampleFormat, &kind[..]))
        .and_then(|()| image.write_tag(Tag::StripOffsets, K::convert_slice(&offsets)))
        .and_then(|()| image.write_tag(Tag::StripByteCounts, K::convert_slice(&sizes)))
        .and_then(|()| image.finish());
    ended.map_err(failed)
}

/// Where the image lies and what it shows.
fn describe<W: Write + Seek, K: TiffKind>(
    image: &mut DirectoryEncoder<'_, W, K>,
    description: &Description,
    period: Period,
) -> TiffResult<()> {
    let Grid {
        north_deg,
        west_deg,
        dlat_deg,
        dlon_deg,
        ..
    } = description.grid;
    image.write_tag(Tag::ModelPixelScaleTag, &[dlon_deg, dlat_deg, 0.0][..])?;
    let corner = [0.0, 0.0, 0.0, west_deg, north_deg, 0.0];
    image.write_tag(Tag::ModelTiepointTag, &corner[..])?;
    image.write_tag(Tag::GeoKeyDirectoryTag, &WGS84_KEYS[..])?;
    let said = metadata(description, period);
    image.write_tag(Tag::Unknown(GDAL_METADATA), said.as_str())?;
    image.write_tag(Tag::GdalNodata, "nan")
}

/// One band of 32-bit numbers, packed in strips of so many rows: what the library says of an image that it is given whole.
fn of_image<W: Write + Seek, K: TiffKind>(
    image: &mut DirectoryEncoder<'_, W, K>,
    [rows, cols, strip_rows]: [u32; 3],
) -> TiffResult<()> {
    image.write_tag(Tag::ImageWidth, cols)?;
    image.write_tag(Tag::ImageLength, rows)?;
    image.write_tag(Tag::Compression, CompressionMethod::Deflate.to_u16())?;
    image.write_tag(Tag::Predictor, Predictor::None.to_u16())?;
    let black = PhotometricInterpretation::BlackIsZero.to_u16();
    image.write_tag(Tag::PhotometricInterpretation, black)?;
    image.write_tag(Tag::RowsPerStrip, strip_rows)?;
    image.write_tag(Tag::SamplesPerPixel, 1u16)?;
    for resolution in [Tag::XResolution, Tag::YResolution] {
        image.write_tag(resolution, Rational { n: 1, d: 1 })?;
    }
    image.write_tag(Tag::ResolutionUnit, ResolutionUnit::None.to_u16())
}

/// What a step is, as GDAL shows it: of the file, and of its one band.
fn metadata(description: &Description, period: Period) -> String {
    let quantity = description.quantity;
    let version = description
        .version
        .as_ref()
        .map(ToString::to_string)
        .unwrap_or_default();
    let of_file = [
        ("TITLE", description.title.clone()),
        ("SOURCE", description.source.clone()),
        ("VERSION", version),
        ("PERIOD_START", period.start.to_string()),
        ("PERIOD_END", period.end.to_string()),
        (
            "SYNTHETIC",
            if description.synthetic { "YES" } else { "NO" }.to_owned(),
        ),
    ];
    let mut xml = "<GDALMetadata>\n".to_owned();
    for (name, text) in of_file {
        let item = format!("  <Item name=\"{name}\">{}</Item>\n", escaped(&text));
        xml.push_str(&item);
    }
    for (role, name, text) in [
        ("description", "DESCRIPTION", quantity.title()),
        ("unittype", "UNITTYPE", quantity.unit()),
    ] {
        let item = format!(
            "  <Item name=\"{name}\" sample=\"0\" role=\"{role}\">{}</Item>\n",
            escaped(text)
        );
        xml.push_str(&item);
    }
    xml + "</GDALMetadata>\n"
}

/// Text of a document of XML. Tags of TIFF hold ASCII.
fn escaped(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            // GDAL writes and reads it escaped twice.
            '&' => plain += "&amp;amp;",
            c if c.is_control() => plain.push(' '),
            c if c.is_ascii() && !matches!(c, '<' | '>' | '"') => plain.push(c),
            c => {
                let reference = format!("&#{};", u32::from(c));
                plain.push_str(&reference);
            }
        }
    }
    plain
}

/// `2000-01-01T00:00:00Z` as `20000101T000000Z`; a file's name has no colons.
fn compact(time: TimeMs) -> String {
    time.to_string().replace(['-', ':'], "")
}

#[cfg(test)]
mod tests;
