//! A secret from a file: read once, given to the client, never shown.

use std::io::Read as _;
use std::path::Path;

use crate::KafkaFailure;

/// Longest secret, bytes.
const MAX_SECRET_BYTES: u64 = 4096;

/// Reads a file of one line.
pub(crate) fn read(flag: &'static str, path: &Path) -> Result<String, KafkaFailure> {
    let bad = |reason: String| KafkaFailure::File {
        flag,
        path: path.to_owned(),
        reason,
    };
    let file = std::fs::File::open(path).map_err(|e| bad(e.to_string()))?;
    let mut text = String::new();
    // What could not be read as text may be part of the secret: the reason does not show it.
    file.take(MAX_SECRET_BYTES + 1)
        .read_to_string(&mut text)
        .map_err(|e| bad(e.kind().to_string()))?;
    if text.len() as u64 > MAX_SECRET_BYTES {
        return Err(bad(format!("it is longer than {MAX_SECRET_BYTES} bytes")));
    }
    let line = text.trim_end_matches(['\r', '\n']);
    if line.is_empty() {
        return Err(bad("it is empty".to_owned()));
    }
    if line.chars().any(char::is_control) {
        return Err(bad("it must be one line of text".to_owned()));
    }
    Ok(line.to_owned())
}

/// Can the file be read? The client reads it itself, but says less about what is wrong.
pub(crate) fn check_readable(flag: &'static str, path: &Path) -> Result<String, KafkaFailure> {
    let bad = |reason: String| KafkaFailure::File {
        flag,
        path: path.to_owned(),
        reason,
    };
    let file = std::fs::File::open(path).map_err(|e| bad(e.to_string()))?;
    if !file.metadata().is_ok_and(|about| about.is_file()) {
        return Err(bad("it is not a file".to_owned()));
    }
    let text = path
        .to_str()
        .ok_or_else(|| bad("its name is not UTF-8".to_owned()))?;
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_is_one_line_and_a_refusal_does_not_show_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("password");
        let refusal = |content: &str| {
            std::fs::write(&path, content).unwrap();
            read("--kafka-password-file", &path)
                .unwrap_err()
                .to_string()
        };
        for content in ["", "\n", "hush\nhush", &"hush".repeat(2000)] {
            let text = refusal(content);
            assert!(
                text.contains("--kafka-password-file") && !text.contains("hush"),
                "{text}"
            );
        }
        std::fs::write(&path, "hush hush\r\n").unwrap();
        assert_eq!(read("f", &path).unwrap(), "hush hush");
        let missing = read("f", &folder.path().join("nothing")).unwrap_err();
        assert!(!missing.is_retryable(), "{missing}");
    }
}
