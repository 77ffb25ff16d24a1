//! Names of datasets and platforms from what files give: any text in, a valid name out.

use contract::product::ProductId;

use super::Source;

/// Longest name of a platform, bytes.
const MAX_PLATFORM_BYTES: usize = 64;

/// The dataset that the sender wants, or one named by some text.
pub(super) fn dataset(source: Source<'_>, text: &str) -> ProductId {
    if let Some(wanted) = source.dataset {
        return wanted.clone();
    }
    slug(text)
        .parse()
        .unwrap_or_else(|_empty| "observations".parse().expect("it is a valid name"))
}

/// The name of a file without its endings.
pub(super) fn stem(file_name: &str) -> &str {
    let stem = file_name.split('.').next().unwrap_or_default();
    if stem.is_empty() { file_name } else { stem }
}

/// A platform's name: printable, not longer than it may be; none if nothing is left.
pub(super) fn platform(text: &str) -> Option<String> {
    let plain: String = text
        .trim_matches(|c: char| c.is_whitespace() || c == '\0')
        .chars()
        .filter(|c| !c.is_control())
        .collect();
    let end = plain.floor_char_boundary(MAX_PLATFORM_BYTES);
    let name = plain[..end].trim();
    (!name.is_empty()).then(|| name.to_owned())
}

/// A platform's name with a number behind it, not longer than it may be.
pub(super) fn numbered(platform: &str, number: u32) -> String {
    let end = format!("-{number}");
    let room = platform.floor_char_boundary(MAX_PLATFORM_BYTES - end.len());
    format!("{}{end}", &platform[..room])
}

/// Lower-case letters, digits and single dashes, beginning with a letter.
fn slug(text: &str) -> String {
    let mut slug = String::new();
    for c in text.chars().map(|c| c.to_ascii_lowercase()) {
        if c.is_ascii_lowercase() || c.is_ascii_digit() {
            slug.push(c);
        } else if !slug.is_empty() && !slug.ends_with('-') {
            slug.push('-');
        }
    }
    if slug.starts_with(|c: char| c.is_ascii_digit()) {
        slug.insert_str(0, "set-");
    }
    slug.truncate(64);
    slug.trim_end_matches('-').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_becomes_a_valid_name() {
        let source = Source {
            file_name: "",
            dataset: None,
        };
        for (text, expected) in [
            ("dsg_timeseries_example", "dsg-timeseries-example"),
            ("74JC20131009", "set-74jc20131009"),
            ("../../etc/passwd", "etc-passwd"),
            ("\u{1b}[2J", "set-2j"),
            ("", "observations"),
        ] {
            assert_eq!(dataset(source, text).as_str(), expected);
        }
        assert!(dataset(source, &"a".repeat(1000)).as_str().len() <= 64);
        let wanted = "mine".parse().unwrap();
        let source = Source {
            dataset: Some(&wanted),
            ..source
        };
        assert_eq!(dataset(source, "theirs"), wanted);
    }

    #[test]
    fn a_platform_is_one_short_line() {
        assert_eq!(platform(" 0n110w\0\0").as_deref(), Some("0n110w"));
        assert_eq!(platform("a\nb").as_deref(), Some("ab"));
        assert_eq!(platform(&"é".repeat(100)).map(|n| n.len()), Some(64));
        assert_eq!(platform("\0 \n"), None);
        assert_eq!(numbered("made", 12), "made-12");
        assert_eq!(numbered(&"é".repeat(32), 12).len(), 63);
    }
}
