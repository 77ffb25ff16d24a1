//! Region files: GeoJSON or well-known text in, a region out.

use std::path::Path;

use contract::geometry_text::MAX_TEXT_BYTES;
use contract::region::Region;

use super::rings::rings;
use crate::ComputeError;

/// Endings of region files.
pub const ENDINGS: [&str; 3] = ["geojson", "json", "wkt"];

/// Does a word name a region file rather than a region?
pub fn is_file_name(word: &str) -> bool {
    let ending = Path::new(word)
        .extension()
        .and_then(|ending| ending.to_str())
        .map(str::to_ascii_lowercase);
    // Text of a region may end in anything, also in what looks like an ending.
    !word.trim_start().starts_with('{')
        && ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

/// Reads a region file.
pub fn read(path: &Path) -> Result<Region, ComputeError> {
    let text = text(path)?;
    let failed = |reason: String| failed(path, reason);
    let region = text.parse().map_err(|e| {
        let contract::ContractError::Invalid { reason, .. } = e;
        failed(reason)
    })?;
    // What is wrong with a ring is best said while its file is at hand.
    match rings(&region) {
        Ok(_rings) => Ok(region),
        Err(ComputeError::Region { reason }) => Err(failed(reason)),
        Err(other) => Err(other),
    }
}

fn failed(path: &Path, reason: String) -> ComputeError {
    ComputeError::RegionFile {
        file: path.display().to_string(),
        reason,
    }
}

/// The text of a file with a region or a line.
pub fn text(path: &Path) -> Result<String, ComputeError> {
    let failed = |reason: String| failed(path, reason);
    let meta = std::fs::metadata(path).map_err(|e| failed(e.to_string()))?;
    if !meta.is_file() {
        return Err(failed("it is no file".to_owned()));
    }
    if meta.len() > MAX_TEXT_BYTES as u64 {
        return Err(failed(format!(
            "{} bytes, at most {MAX_TEXT_BYTES} are taken; simplify it",
            meta.len()
        )));
    }
    std::fs::read_to_string(path).map_err(|e| failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,1],[0,0]]]}"#;

    #[test]
    fn a_file_holds_geojson_or_well_known_text() {
        let folder = tempfile::tempdir().unwrap();
        let region = |name: &str, text: &str| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).unwrap();
            assert!(is_file_name(file.to_str().unwrap()));
            read(&file)
        };
        let square = region("a.geojson", SQUARE).unwrap();
        let wkt = "POLYGON((0 0,1 0,1 1,0 1,0 0))\n";
        assert_eq!(region("a.WKT", wkt).unwrap(), square);
        for (text, expected) in [
            (SQUARE.replace("[1,1]", "[1,91]"), "no longitude, latitude"),
            (
                SQUARE.replace("[1,1]", "[500000,4000000]"),
                "no longitude, latitude",
            ),
            (
                SQUARE.replace("[[0,0],[1,0],[1,1],", "["),
                "fewer than three",
            ),
            (String::new(), "global"),
        ] {
            let error = region("b.json", &text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
            assert!(error.contains("b.json"), "{error}");
        }
    }

    #[test]
    fn a_region_as_text_is_no_file_name() {
        assert!(!is_file_name("global"));
        assert!(!is_file_name("1,2,3,4.5"));
        assert!(!is_file_name(r#"{"type":"Polygon","name":"x.json"#));
    }

    #[test]
    fn a_file_that_is_none_is_named_in_the_refusal() {
        let error = read(Path::new("/nowhere/region.geojson"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("/nowhere/region.geojson"), "{error}");
        let folder = tempfile::tempdir().unwrap();
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("no file"), "{error}");
    }
}
