//! One GeoTIFF a step: 32-bit values on WGS 84, NaN for no data, with the period of the step and the unit as GDAL keeps them.

use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use contract::grid::Grid;
use contract::time::{Period, TimeMs};
use cube::Description;
use tempfile::TempDir;
use tiff::TiffResult;
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, TiffKind, colortype};
use tiff::tags::Tag;

use crate::{ExportError, Written, folder_of};

/// What GDAL says of a file, XML.
const GDAL_METADATA: u16 = 42112;
/// Geographic coordinates (1024: 2), cells are areas (1025: 1), WGS 84 (2048: 4326): version 1.1.0, three keys.
const WGS84_KEYS: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326];
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
    fn append(&mut self, period: Period, values: &[f32]) -> Result<(), ExportError> {
        let grid = &self.description.grid;
        ExportError::check(values.len(), grid)?;
        let name = format!("{}_{}.tif", self.description.product, compact(period.start));
        let path = self.part.path().join(&name);
        let file = File::create_new(&path).map_err(ExportError::io(&path))?;
        let mut file = BufWriter::new(file);
        let is_big = grid.cell_count() as u64 * 4 > BIG_BYTES;
        let written = if is_big {
            TiffEncoder::new_big(&mut file)
                .and_then(|tiff| write(tiff, &self.description, period, values))
        } else {
            TiffEncoder::new(&mut file)
                .and_then(|tiff| write(tiff, &self.description, period, values))
        };
        written.map_err(ExportError::library(&path))?;
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

fn write<W: Write + Seek, K: TiffKind>(
    tiff: TiffEncoder<W, K>,
    description: &Description,
    period: Period,
    values: &[f32],
) -> TiffResult<()> {
    let Grid {
        rows,
        cols,
        north_deg,
        west_deg,
        dlat_deg,
        dlon_deg,
    } = description.grid;
    let mut tiff = tiff.with_compression(Compression::Deflate(DeflateLevel::Balanced));
    let mut image = tiff.new_image::<colortype::Gray32Float>(cols, rows)?;
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[dlon_deg, dlat_deg, 0.0][..])?;
    let corner = [0.0, 0.0, 0.0, west_deg, north_deg, 0.0];
    tags.write_tag(Tag::ModelTiepointTag, &corner[..])?;
    tags.write_tag(Tag::GeoKeyDirectoryTag, &WGS84_KEYS[..])?;
    tags.write_tag(
        Tag::Unknown(GDAL_METADATA),
        metadata(description, period).as_str(),
    )?;
    tags.write_tag(Tag::GdalNodata, "nan")?;
    image.write_data(values)
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
