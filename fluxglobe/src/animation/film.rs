//! Where the pictures of an animation go, told by the name of the output.

use std::path::Path;

use anyhow::{Result, bail};
use bytes::Bytes;

use super::encoder::{self, Container, Encoder};
use super::folder::Folder;
use super::shots::Shots;
use super::strip::Strip;
use crate::cli::RenderAnimation;

/// An animation being written.
pub(super) enum Film {
    /// A PNG file a picture.
    Folder(Folder),
    /// An animated PNG.
    Strip(Box<Strip>),
    /// What ffmpeg writes.
    Encoder(Box<Encoder>),
}

/// What the name of an output says that is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Folder,
    Strip,
    Film(Container),
}

/// Can the output of the options be written? What is not there is told before anything is drawn.
pub(super) fn check(options: &RenderAnimation) -> Result<()> {
    match kind(&options.globe.picture.output)? {
        Kind::Film(container) => encoder::check(&options.ffmpeg, container),
        Kind::Folder | Kind::Strip => Ok(()),
    }
}

impl Film {
    /// Opens the output of the options.
    pub(super) fn open(options: &RenderAnimation, shots: &Shots) -> Result<Self> {
        let output = &options.globe.picture.output;
        Ok(match kind(output)? {
            Kind::Folder => Self::Folder(Folder::open(output, shots)?),
            Kind::Strip => Self::Strip(Box::new(Strip::open(output, shots)?)),
            Kind::Film(container) => {
                let encoder = Encoder::start(&options.ffmpeg, container, output, shots)?;
                Self::Encoder(Box::new(encoder))
            }
        })
    }

    /// Numbers of the pictures that are still to be drawn.
    pub(super) fn missing(&self, shots: &Shots) -> Result<Vec<u32>> {
        match self {
            Self::Folder(folder) => folder.missing(),
            Self::Strip(_) | Self::Encoder(_) => Ok((0..shots.count()).collect()),
        }
    }

    /// Takes the next picture.
    pub(super) async fn add(&mut self, number: u32, png: Bytes) -> Result<()> {
        match self {
            Self::Folder(folder) => folder.add(number, &png),
            Self::Strip(strip) => strip.add(&png),
            Self::Encoder(encoder) => encoder.add(&png).await,
        }
    }

    /// Ends the output; bytes written.
    pub(super) async fn finish(self) -> Result<u64> {
        match self {
            Self::Folder(folder) => folder.size_bytes(),
            Self::Strip(strip) => strip.finish(),
            Self::Encoder(encoder) => encoder.finish().await,
        }
    }

    /// Leaves nothing half-written behind; pictures in a folder stay, for the next run to go on from.
    pub(super) async fn abandon(self) {
        match self {
            Self::Folder(_) => (),
            Self::Strip(strip) => strip.abandon(),
            Self::Encoder(encoder) => encoder.abandon().await,
        }
    }
}

/// A folder has no ending, one at its end, or is there already; of all else the ending says what it is.
fn kind(path: &Path) -> Result<Kind> {
    let name = path.as_os_str().to_string_lossy();
    let ending = path.extension().map(|ending| ending.to_string_lossy());
    let Some(ending) = ending.filter(|_| !name.ends_with(std::path::MAIN_SEPARATOR)) else {
        return Ok(Kind::Folder);
    };
    let ending = ending.to_ascii_lowercase();
    if path.is_dir() {
        return Ok(Kind::Folder);
    }
    if ending == "png" || ending == "apng" {
        return Ok(Kind::Strip);
    }
    match Container::named(&ending) {
        Some(container) => Ok(Kind::Film(container)),
        None => bail!(
            "{}: an animation is written to a file that ends in .mp4, .webm, .webp, .gif or .png, or to a folder: a name \
             without an ending, one that ends in /, or a folder that is there",
            path.display()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_that_is_not_written_is_refused_and_makes_no_folder_of_that_name() {
        let place = tempfile::tempdir().unwrap();
        let kind = |name: &str| kind(&place.path().join(name));
        for (name, expected) in [
            ("a.mp4", Kind::Film(Container::Mp4)),
            ("a.WEBM", Kind::Film(Container::Webm)),
            ("a.webp", Kind::Film(Container::Webp)),
            ("a.gif", Kind::Film(Container::Gif)),
            ("a.png", Kind::Strip),
            ("a.apng", Kind::Strip),
            ("pictures", Kind::Folder),
            ("run.2/", Kind::Folder),
        ] {
            assert_eq!(kind(name).unwrap(), expected, "{name}");
        }
        for name in ["year.avi", "year.mov", "year.jpg", "run.2"] {
            let refused = kind(name).unwrap_err().to_string();
            assert!(
                refused.contains(name) && refused.contains(".mp4, .webm, .webp, .gif or .png"),
                "{refused}"
            );
        }
        std::fs::create_dir(place.path().join("run.2")).unwrap();
        assert_eq!(kind("run.2").unwrap(), Kind::Folder);
    }
}
