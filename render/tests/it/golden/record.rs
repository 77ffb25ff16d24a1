//! Which golden pictures each version of the renderer drew, and in which bytes: `tests/golden/versions.txt`.
//!
//! A picture's name holds the version and not its pixels, and what is stored under a name stays there. So a picture that
//! changes needs a new version, and so do the bytes that the encoder makes of the same pixels.

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};
use std::str::FromStr;

use contract::digest::Digest;
use render::Image;

const HEAD: &str = "# Written by `make bless`: renderer version, picture, SHA-256 of the PNG bytes that the encoder makes of it.\n";

/// Digests by version and name of a picture.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Record {
    digests: BTreeMap<u32, BTreeMap<String, Digest>>,
}

/// What a picture is against the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// The one that this version is known to draw.
    Known,
    /// This version is not known to draw a picture of this name.
    New,
    /// This version is known to draw another one.
    Changed,
}

/// What stands for a picture: the bytes that are stored of it.
pub(super) fn digest(image: &Image) -> Digest {
    Digest::of(&image.encode_png().unwrap())
}

impl Record {
    pub(super) fn standing(&self, version: u32, name: &str, digest: Digest) -> Standing {
        match self.digests.get(&version).and_then(|all| all.get(name)) {
            None => Standing::New,
            Some(known) if *known == digest => Standing::Known,
            Some(_other) => Standing::Changed,
        }
    }

    /// Takes a picture in; the reason if the version is known to draw another one.
    pub(super) fn add(&mut self, version: u32, name: &str, digest: Digest) -> Result<(), String> {
        if self.standing(version, name, digest) == Standing::Changed {
            return Err(changed(version, name));
        }
        let all = self.digests.entry(version).or_default();
        all.insert(name.to_owned(), digest);
        Ok(())
    }

    /// What is wrong with the pictures there are, if this is the version that drew them.
    pub(super) fn quarrels(&self, version: u32, there: &BTreeMap<String, Digest>) -> Vec<String> {
        let mut all = vec![];
        for (name, digest) in there {
            match self.standing(version, name, *digest) {
                Standing::Known => {}
                Standing::New => all.push(format!(
                    "renderer version {version} is not known to draw {name}: run `make bless`"
                )),
                Standing::Changed => all.push(changed(version, name)),
            }
        }
        let known = self.digests.get(&version).into_iter().flatten();
        let gone = known.filter(|(name, _)| !there.contains_key(*name));
        all.extend(gone.map(|(name, _)| format!("{name} is gone; take it out of versions.txt")));
        let newer = self.digests.range(version + 1..);
        all.extend(newer.map(|(newer, _)| {
            format!("versions.txt knows version {newer}, newer than {version}: versions go up")
        }));
        all
    }
}

fn changed(version: u32, name: &str) -> String {
    format!(
        "{name} is another picture, or other bytes of it, than renderer version {version} drew before: stored pictures \
         would pass for new ones. Raise RENDERER_VERSION in contract/src/job.rs, then run `make bless`"
    )
}

impl FromStr for Record {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut record = Self::default();
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        for line in lines {
            let bad = || format!("versions.txt: {line:?} is no VERSION NAME DIGEST");
            let words: Vec<&str> = line.split_whitespace().collect();
            let [version, name, digest] = words[..] else {
                return Err(bad());
            };
            let version = version.parse().map_err(|_not_a_number| bad())?;
            let digest = digest.parse().map_err(|_not_a_digest| bad())?;
            record.add(version, name, digest)?;
        }
        Ok(record)
    }
}

impl Display for Record {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(HEAD)?;
        for (version, all) in &self.digests {
            for (name, digest) in all {
                writeln!(f, "{version} {name} {digest}")?;
            }
        }
        Ok(())
    }
}

#[test]
fn a_changed_picture_needs_a_new_version_and_a_new_one_does_not() {
    let [one, other] = [Digest::of(b"one"), Digest::of(b"other")];
    let mut record = Record::default();
    record.add(4, "tile", one).unwrap();
    record.add(4, "tile", one).unwrap();
    let refused = record.add(4, "tile", other).unwrap_err();
    assert!(refused.contains("Raise RENDERER_VERSION"), "{refused}");
    record.add(4, "globe", other).unwrap();
    record.add(5, "tile", other).unwrap();
    assert_eq!(record.to_string().parse(), Ok(record));
}

#[test]
fn pictures_that_are_not_those_of_the_version_are_told() {
    let [one, other] = [Digest::of(b"one"), Digest::of(b"other")];
    let mut record = Record::default();
    record.add(4, "tile", one).unwrap();
    let there = |digest| BTreeMap::from([("tile".to_owned(), digest)]);
    let said = |version, digest| record.quarrels(version, &there(digest)).join("; ");
    assert_eq!(said(4, one), "");
    assert!(said(4, other).contains("Raise RENDERER_VERSION"));
    assert!(said(5, one).contains("make bless"));
    assert!(said(3, one).contains("newer than 3"));
    assert!(record.quarrels(4, &BTreeMap::new())[0].contains("tile is gone"));
}
